"""The old name of `semgs.model.memory_plan`."""

from __future__ import annotations

from semgs.model.plan import NotEnoughMemoryError, Plan, plan

__all__ = ["NotEnoughMemoryError", "Plan", "plan"]
