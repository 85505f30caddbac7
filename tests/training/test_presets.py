"""The numbers of the paper's training."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from semgs.model.switches import Switches
from semgs.objectives.loss_weights import LossWeights
from semgs.training.data.data_settings import Augmentation
from semgs.training.presets import PRESETS, base, base_text, paper, small
from semgs.training.state import TrainingState
from semgs.training.supervision.supervision import make_supervision
from semgs.training.training_settings import differences


def test_paper_is_the_papers_training():
    settings = paper()
    # 4 GPUs with 2 scenes each; its data and MVSplat's weights cannot come with us.
    assert (settings.model, settings.learning_rate, settings.steps, settings.batch) == ("base", 2e-4, 300_000, 8)
    assert settings.losses == LossWeights(semantic=0.1, colour=1.0, smoothness=0.001)
    assert (settings.contexts, settings.clip, settings.init, settings.data) == ((2, 4), 0.5, "", ())
    assert (settings.class_weights, settings.depth_weight, settings.context_targets) == (None, 0, False)
    assert (settings.sampling, settings.augmentation, settings.network) == ("even", Augmentation(), Switches())
    with pytest.raises(ValueError, match="no data"):
        settings.check_complete()


def test_the_paper_word_by_word_differs_from_its_preset_in_the_network_the_smoothness_and_the_start():
    literal = differences(base_text(), paper())
    assert literal == {
        "model": ("base_text", "base"),
        "network": (Switches(output_transform=False, paper_heads=True), Switches()),
        "losses": (LossWeights(0.1, 1.0, 0.001, smoothness_over="sum"), LossWeights(0.1, 1.0, 0.001)),
        "init": ("random", ""),
    }


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_knows_its_name_which_decides_nothing(name):
    assert PRESETS[name]().preset == name
    assert replace(PRESETS[name](), preset="") == PRESETS[name]()


def test_small_and_base_draw_rooms():
    assert small().data == base().data == ("rooms",)
    assert small().init == base().init == "random"


def test_base_trains_with_the_papers_numbers(network):
    settings = base()
    assert (settings.learning_rate, settings.steps, settings.batch) == (2e-4, 300_000, 2)
    assert settings.losses == LossWeights(semantic=0.1, colour=1.0, smoothness=0.001)
    assert settings.contexts == (2, 4)
    assert settings.class_weights is None
    assert settings.depth_weight == 0
    assert not settings.context_targets
    state = TrainingState.begin(network(), make_supervision(settings), settings.learning_rate, settings.average_decay)
    assert type(state.optimizer) is torch.optim.Adam
    assert state.optimizer.defaults["weight_decay"] == 0


def test_settings_in_a_file_that_travels_name_no_place_of_the_machine():
    settings = replace(
        small(), data=("rooms=2", "/home/ann/scans/office=1"), init="hf://ann/small", teacher="", backbone="/home/ann/runs/3/best.safetensors", assets=("/data/assets",)
    )  # fmt: skip
    told = settings.published()
    assert (told["data"], told["init"], told["assets"]) == (("rooms=2", "office=1"), "hf://ann/small", ("assets",))
    assert (told["teacher"], told["backbone"]) == ("", "3/best.safetensors")
    assert {name for name, value in told.items() if value != settings.as_json()[name]} == {"data", "backbone", "assets"}
