from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.tables.ablation import ROWS, ablation_grid, row_settings, steps_grid
from semgs.evaluation.tables.evaluation_report import SavedReport, SavedResult
from semgs.evaluation.tables.table_grid import printed
from semgs.model.switches import Switches
from semgs.objectives.loss_weights import LossWeights
from semgs.training.presets import small

PAPER = [  # the check marks of the paper's Table III: Sh-Layer, Sw-Trans, C-Inj, Sm-Loss
    (False, False, False, False),
    (True, False, False, False),
    (True, True, False, False),
    (True, True, True, False),
    (True, True, True, True),
]


def test_the_rows_are_those_of_the_paper():
    found = []
    for row in ROWS:
        settings = row_settings(small(), row, 5)
        network = settings.network
        assert network.camera_aware_colour == network.camera_aware_semantic
        parts = (
            network.shared_layers,
            network.windows > 1,
            network.camera_aware_colour,
            settings.losses.smoothness > 0,
        )
        assert parts == row.parts
        found.append(parts)
    assert found == PAPER


def test_nothing_else_differs_between_rows_of_a_seed():
    settings = replace(small(), steps=7, losses=LossWeights(0.2, 0.9, 0.003))
    rows = [row_settings(settings, row, 9) for row in ROWS]
    assert all(
        replace(row, network=settings.network, losses=settings.losses) == replace(settings, seed=9) for row in rows
    )
    assert [one.losses for one in rows[:4]] == [LossWeights(0.2, 0.9, 0.0)] * 4
    assert rows[4] == replace(settings, seed=9)


@pytest.mark.parametrize(
    "settings",
    [replace(small(), network=Switches(windows=1)), replace(small(), losses=LossWeights(smoothness=0.0))],
)
def test_a_full_method_that_lacks_a_part_is_refused(settings):
    with pytest.raises(ValueError, match=r"the full method lacks (Sw-Trans|Sm-Loss)"):
        row_settings(settings, ROWS[0], 1)


def report(correct: int, scenes: int = 6) -> SavedReport:
    """A report of one target of ten pixels in each scene, of two equal classes, of which `correct` are right."""
    frames = []
    for scene in range(scenes):
        wrong = 10 - min(10, correct + scene % 2)
        matrix = np.array([[5, 0], [wrong, 5 - wrong]]) if wrong <= 5 else np.array([[10 - wrong, wrong - 5], [5, 0]])
        frames.append(
            FrameScores(f"room_{scene}", "3.png", ("2.png", "4.png"), confusion=matrix, truth=np.array([5, 5]))
        )
    confusion = sum(frame.confusion for frame in frames)
    hit = np.diag(confusion)
    iou = hit / (confusion.sum(0) + confusion.sum(1) - hit)
    numbers = {
        "miou": iou.mean(), "miou_per_image": None, "accuracy": hit.sum() / confusion.sum(),
        "class_accuracy": (hit / confusion.sum(1)).mean(), "intervals": {"miou": [0.1, 0.9]}, "intervals_over": "scenes",
    }  # fmt: skip
    result = SavedResult(4, numbers, {}, tuple(frames), "truth")
    return SavedReport(Path("report.json"), "row", "neighbours", {}, "two", {4: result})


def test_the_table_marks_the_parts_and_shows_value_and_interval():
    grid = ablation_grid({("none", 1): report(6), ("full", 1): report(8)}, 4)
    assert [[cell.text for cell in row[:5]] for row in grid.rows] == [
        ["none", "–", "–", "–", "–"],
        ["+ Sm-Loss", "✓", "✓", "✓", "✓"],
    ]
    first = report(6).results[4].numbers
    assert grid.rows[0][5].text == f"{first['miou']:.3f} (0.100–0.900)"
    assert grid.rows[0][6].text == "–"
    assert grid.rows[0][7].text == f"{first['accuracy']:.3f}"
    assert "6 targets" in grid.title


def test_several_seeds_become_their_mean_and_half_of_their_range():
    grid = ablation_grid({("full", 1): report(6), ("full", 2): report(8)}, 4)
    values = [report(correct).results[4].numbers["accuracy"] for correct in (6, 8)]
    assert grid.rows[0][7].text == f"{sum(values) / 2:.3f} ± {(values[1] - values[0]) / 2:.3f}"
    assert "2 seeds" in grid.notes[-1]


def test_steps_are_each_row_minus_the_row_above_with_the_same_seed():
    reports = {("none", 1): report(6), ("shared", 1): report(8), ("shared", 2): report(7), ("camera", 1): report(9)}
    grid = steps_grid(reports, 4)
    assert [(row[0].text, row[1].text) for row in grid.rows] == [("+ Sh-Layer", "1")]
    accuracy = report(8).results[4].numbers["accuracy"] - report(6).results[4].numbers["accuracy"]
    column = grid.head.index("acc.")
    assert grid.rows[0][column].text.startswith(f"{accuracy:+.3f} (")
    assert grid.rows[0][column].marked  # every scene gained
    assert "+ Sh-Layer" in printed(grid, "markdown")
