"""Names that docs and scripts taught before evaluation had folders: they stay for one release."""

from __future__ import annotations

from importlib import import_module

import pytest


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("calibration.calibration", "scoring.confidence.temperature_effect"),
        ("calibration.statements", "scoring.confidence.statements"),
        ("evaluate.evaluate", "scoring.evaluate.evaluate"),
        ("network.NetworkMethod", "frames.network.NetworkMethod"),
        ("plan.make_plan", "frames.frame_plan.make_plan"),
        ("plan.pinned_plan", "frames.frame_plan.pinned_plan"),
        ("predictions.Prediction", "frames.predictions.Prediction"),
        ("protocols.neighbours", "frames.protocols.neighbours"),
        ("report.read_report", "tables.evaluation_report.read_report"),
        ("summary.summary", "scoring.summary.summary"),
    ],
)
def test_an_old_name_is_the_new_one(old: str, new: str):
    first, second = (
        getattr(import_module(f"semgs.evaluation.{module}"), name)
        for module, _, name in (one.rpartition(".") for one in (old, new))
    )
    assert first is second
