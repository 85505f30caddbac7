"""Names that moved still resolve, for one release."""

from __future__ import annotations

from semgs.model import memory_plan, plan


def test_the_plan_of_memory_has_its_old_names():
    assert plan.plan is memory_plan.memory_plan
    assert plan.Plan is memory_plan.MemoryPlan
    assert plan.NotEnoughMemoryError is memory_plan.NotEnoughMemoryError
