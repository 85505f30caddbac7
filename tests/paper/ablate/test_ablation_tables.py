from __future__ import annotations

from pathlib import Path

import numpy as np

from paper.ablate.ablation_rows import ROWS, SEMANTIC_ROWS
from paper.ablate.ablation_tables import ablation_grid, steps_grid, where_grid
from paper.ablate.view_relations import ViewRelation
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.tables.saved_report import SavedReport, SavedResult
from semgs.evaluation.tables.table_grid import printed


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
    grid = ablation_grid(ROWS, {("none", 1): report(6), ("full", 1): report(8)}, 4)
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
    grid = ablation_grid(ROWS, {("full", 1): report(6), ("full", 2): report(8)}, 4)
    values = [report(correct).results[4].numbers["accuracy"] for correct in (6, 8)]
    assert grid.rows[0][7].text == f"{sum(values) / 2:.3f} ± {(values[1] - values[0]) / 2:.3f}"
    assert "2 seeds" in grid.notes[-1]


def test_steps_are_each_row_minus_the_row_above_over_the_seeds_that_have_both():
    reports = {("none", 1): report(6), ("shared", 1): report(8), ("shared", 2): report(7), ("camera", 1): report(9)}
    grid = steps_grid(ROWS, reports, 4)
    assert [row[0].text for row in grid.rows] == ["+ Sh-Layer"]
    accuracy = report(8).results[4].numbers["accuracy"] - report(6).results[4].numbers["accuracy"]
    column = grid.head.index("acc.")
    assert grid.rows[0][column].text.startswith(f"{accuracy:+.3f} (")
    assert grid.rows[0][column].marked  # every scene gained
    assert "+ Sh-Layer" in printed(grid, "markdown")
    assert grid.notes[-1] == "Intervals are over scenes; training again would vary by more."
    both = steps_grid(ROWS, reports | {("none", 2): report(7)}, 4)
    assert both.rows[0][column].text.startswith(f"{accuracy / 2:+.3f} (")  # the second seed gained nothing
    assert not both.rows[0][column].marked
    assert both.notes[-1].startswith("Intervals are over scenes, and over seeds. How much seeds differ")


def test_with_few_scenes_the_note_says_that_intervals_are_over_frames():
    grid = steps_grid(ROWS, {("none", 1): report(6, 3), ("shared", 1): report(8, 3)}, 4)
    assert (
        grid.notes[-1]
        == "Intervals are over frames, as there are fewer than 5 scenes; training again would vary by more."
    )


def test_a_seed_of_which_a_row_is_missing_does_not_count_and_other_rows_are_compared_on_their_own():
    """So how much the rows of the paper differ by seed says nothing about the summed loss, nor the other way round."""
    names = ("none", "shared", "windows", "camera", "full")
    reports = {(name, seed): report(5 + number // 2) for number, name in enumerate(names) for seed in (1, 2)}
    reports |= {("smoothness_sum", 1): report(2), ("smoothness_sum", 2): report(4)}
    complete = steps_grid(SEMANTIC_ROWS, reports, 4)
    column = complete.head.index("acc.")
    marked = {row[0].text: row[column].marked for row in complete.rows}
    assert marked == {
        "+ Sh-Layer": False, "+ Sw-Trans": True, "+ C-Inj": False, "+ Sm-Loss": True, "+ Sm-Loss, summed": False,
    }  # fmt: skip
    without = steps_grid(SEMANTIC_ROWS, {key: one for key, one in reports.items() if key != ("full", 2)}, 4)
    assert "seeds" in without.notes[-1]  # of the summed loss
    alone = steps_grid(ROWS, {key: one for key, one in reports.items() if key != ("full", 2)}, 4)
    assert alone.notes[-1] == "Intervals are over scenes; training again would vary by more."


def test_where_a_part_helps_is_told_for_thirds_of_the_targets_by_overlap_and_by_angle():
    """Targets of even scenes gain two of ten pixels, those of odd scenes one."""
    before, after = report(6), report(8)
    relations = [
        ViewRelation(overlap, angle)
        for overlap, angle in zip((0.9, 0.8, 0.3, 0.2, 0.6, 0.5), (1.0, 2.0, 40.0, 50.0, 20.0, 10.0), strict=True)
    ]
    grid = where_grid(ROWS, {("none", 1): before, ("shared", 1): after}, 4, relations)
    assert grid.head == (
        "part", "score", "overlap 0.20–0.30", "overlap 0.50–0.60", "overlap 0.80–0.90", "angle 1–2°", "angle 10–20°", "angle 40–50°",
    )  # fmt: skip
    assert [row[1].text for row in grid.rows] == ["mIoU", "acc."]
    first, second = (sum(np.diag(r.results[4].frames[k].confusion).sum() for k in (2, 3)) for r in (before, after))
    assert grid.rows[1][2].text.startswith(f"{(second - first) / 20:+.3f} (")
