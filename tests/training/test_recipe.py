"""The recipe of the included weights, as settings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from semgs.model.build import build
from semgs.model.networks import base, small
from semgs.model.switches import switched
from semgs.model.weights.initial_weights import changed_switches
from semgs.training.recipe_stages import STAGES, Start, folder, settings_of

OUT = Path("out")


def test_each_stage_starts_from_the_weights_of_the_one_before():
    start = Start(seed=7, backbone="mobilenet.safetensors")
    stages = [settings_of(stage, start, OUT) for stage in STAGES]
    assert [folder(OUT, stage).name for stage in STAGES] == ["1_classes", "2_depth", "3_joint"]
    assert [one.init for one in stages] == [
        "small",
        "out/1_classes/weights.safetensors",
        "out/2_depth/weights.safetensors",
    ]
    assert [one.seed for one in stages] == [7, 8, 9]
    assert [one.supervision for one in stages] == ["pictures", "depth", "rendered"]
    assert [one.backbone for one in stages] == ["mobilenet.safetensors", "", ""]
    assert settings_of("classes", replace(start, model="base"), OUT).init == "random"
    assert settings_of("classes", replace(start, init="mine.safetensors"), OUT).init == "mine.safetensors"


def test_a_share_shortens_every_stage():
    """0.01 of 4,000, 2,500 and 480 steps."""
    stages = [settings_of(stage, Start(share=0.01), OUT) for stage in STAGES]
    assert [one.steps for one in stages] == [40, 25, 5]
    assert [one.validate_every for one in stages] == [40, 25, 5]
    whole = [settings_of(stage, Start(), OUT) for stage in STAGES]
    assert [one.validate_every for one in whole] == [500, 500, 160]


@pytest.mark.parametrize("network", [small, base])
def test_both_networks_have_what_the_stages_switch_on(network):
    settings = network()
    for stage in STAGES:
        requested = settings_of(stage, Start(model=settings.name), OUT).network
        settings = switched(settings, changed_switches(requested, settings.name))
    built = build(settings)
    assert built.pretrained_parameters()
    assert built.colour.depth.reads_cues


@pytest.mark.parametrize(("change", "message"), [({"model": "mvsplat"}, "small, base"), ({"share": 0.0}, "above 0")])
def test_starts_that_cannot_be_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        Start(**change)
