"""The old name of `semgs.model.memory_plan`, for one release."""

from semgs.model.memory_plan import MemoryPlan as Plan
from semgs.model.memory_plan import NotEnoughMemoryError as NotEnoughMemoryError
from semgs.model.memory_plan import memory_plan as plan

__all__ = ["NotEnoughMemoryError", "Plan", "plan"]
