"""Another name of `semgs.model.memory_plan`, which was here first."""

from __future__ import annotations

from semgs.model.plan import NotEnoughMemoryError, Plan, plan

__all__ = ["NotEnoughMemoryError", "Plan", "plan"]
