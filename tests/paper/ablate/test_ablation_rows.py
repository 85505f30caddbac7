"""The rows of the paper's ablation, whole and of the semantic branch alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from paper.ablate.ablation_rows import (
    BASE_STAGES,
    EQUAL_GRADIENT,
    ROWS,
    SEMANTIC_ROWS,
    base_settings,
    row_settings,
    semantic_row_settings,
)
from semgs.model.switches import Switches
from semgs.objectives.loss_weights import LossWeights
from semgs.training.presets import small, small_plain

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


def test_rows_of_the_semantic_branch_differ_in_that_branch_and_its_loss_alone():
    settings = replace(small_plain(), losses=LossWeights(0.1, 1.0, 0.001))
    rows = {row.name: semantic_row_settings(settings, row, 4, Path("base.safetensors")) for row in SEMANTIC_ROWS}
    assert [
        (
            one.network.shared_layers,
            one.network.windows_semantic != 1,
            one.network.camera_aware_semantic,
            one.losses.smoothness > 0,
        )
        for one in list(rows.values())[:5]
    ] == PAPER
    alike = replace(
        settings, supervision="labels", init="base.safetensors", semantic_branch="drawn", shared_rate=0.0, seed=4
    )
    for one in rows.values():
        assert one.network.windows == 2
        assert one.network.camera_aware_colour
        assert replace(one, network=settings.network, losses=settings.losses) == alike
    assert rows["full"].losses == LossWeights(0.1, 1.0, 0.001)
    assert rows["smoothness_sum"].losses == LossWeights(0.1, 1.0, 0.001, smoothness_over="sum")
    assert rows["smoothness_equal"].losses == LossWeights(0.1, 1.0, 0.001 * EQUAL_GRADIENT)
    assert {row.above for row in SEMANTIC_ROWS[4:]} == {"camera"}


def test_the_base_learns_depth_then_colour_and_no_classes():
    settings = replace(small_plain(), steps=800, validate_every=300)
    depth = base_settings(settings, BASE_STAGES[0], None)
    colour = base_settings(settings, BASE_STAGES[1], Path("depth.safetensors"))
    assert (depth.supervision, depth.init, depth.steps, depth.validate_every) == ("depth", "random", 500, 300)
    assert (colour.supervision, colour.init, colour.steps, colour.validate_every) == (
        "rendered",
        "depth.safetensors",
        100,
        100,
    )
    assert colour.sweep_rate == 0
    assert all((one.losses.semantic, one.losses.smoothness, one.class_rate) == (0, 0, 0) for one in (depth, colour))
    assert all(one.network == settings.network for one in (depth, colour))


@pytest.mark.parametrize("supervision", ["labels", "pictures", "depth"])
def test_the_colour_of_the_base_is_learned_from_rendered_views_whatever_the_rows_learn_from(supervision):
    settings = replace(small_plain(), supervision=supervision)
    assert base_settings(settings, "colour", Path("depth.safetensors")) == base_settings(
        small_plain(), "colour", Path("depth.safetensors")
    )


@pytest.mark.parametrize(
    "settings",
    [
        replace(small(), network=Switches(windows=1)),
        replace(small(), network=Switches(windows_semantic=1)),
        replace(small(), losses=LossWeights(smoothness=0.0)),
    ],
)
def test_a_full_method_that_lacks_a_part_is_refused(settings):
    with pytest.raises(ValueError, match=r"the full method lacks (Sw-Trans|Sm-Loss)"):
        row_settings(settings, ROWS[0], 1)
