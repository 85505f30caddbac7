"""What each supervision learns from, and that another one is a class and nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from semgs.data.views import Batch, Views
from semgs.objectives.losses import LossWeights, depth_error
from semgs.training.batches import Portion
from semgs.training.checkpoints import best_checkpoint
from semgs.training.loop import fit
from semgs.training.objective import TERMS, Objective, Supervision
from semgs.training.settings import TrainingSettings
from semgs.training.state import TrainingState
from semgs.training.step import training_step
from semgs.training.supervision import Labels, Pictures, Rendered, supervision_of
from semgs.training.validation import Validation, Verdict
from semgs.weights.start import start


class Undecided(nn.Module):
    """Gives every class of every pixel the same probability, and keeps what it was asked."""

    def classify(self, views: Views, alone: bool = False) -> Tensor:
        self.asked = (len(views), alone)
        return torch.full((*views.images.shape[:-3], 20, *views.size), 1 / 20)


def test_the_settings_name_one_of_three(settings):
    weights = (2.0,) * 20
    settings = replace(settings, class_weights=weights)
    assert supervision_of(settings) == Rendered(LossWeights(0.5, 1.0, 0.1), weights, 0.1, True)
    held = replace(settings, supervision="labels", hold_shared=True)
    assert supervision_of(held) == Labels(weights, hold_shared=True)
    assert supervision_of(replace(held, supervision="pictures", hold_shared=False)) == Pictures(weights)


def test_weights_of_classes_that_are_not_numbers_yet_are_refused(settings):
    with pytest.raises(ValueError, match="expected its numbers, which the survey of the data gives"):
        supervision_of(replace(settings, class_weights="inverse_root_frequency"))


@pytest.mark.parametrize(
    ("supervision", "asked"), [(Labels, (2, False)), (Pictures, (4, True))], ids=["labels", "pictures"]
)
def test_an_undecided_network_loses_the_logarithm_of_the_classes(batch, supervision, asked: tuple[int, bool]):
    one, network = batch(0), Undecided()
    one.context.labels[0, 0] = 255  # one view without any label, whose share of the mean is zero
    terms = Objective(network, supervision())(one)
    assert set(terms) == set(TERMS)
    assert network.asked == asked  # two scenes of so many views
    labelled = (2 * asked[0] - 1) / (2 * asked[0])
    assert float(terms["total"]) == pytest.approx(math.log(20) * labelled, rel=1e-6)
    assert float(terms["unlabelled"]) == 1
    assert float(terms["colour"]) == float(terms["smoothness"]) == float(terms["depth"]) == 0
    assert math.isnan(float(terms["psnr"]))
    doubled = Objective(network, supervision(class_weights=(2.0,) * 20))(one)
    assert float(doubled["total"]) == pytest.approx(2 * float(terms["total"]))


@pytest.mark.parametrize("supervision", [Labels(), Pictures()], ids=["labels", "pictures"])
def test_views_without_labels_are_refused_by_name(batch, supervision: Supervision):
    one = batch(0)
    bare = Batch(replace(one.context, labels=None), replace(one.target, labels=None), one.scenes)
    with pytest.raises(ValueError, match=f"supervision by {type(supervision).__name__.lower()} needs them"):
        supervision.loss(Undecided(), bare)


def test_scenes_without_labels_will_do_only_where_colour_and_depth_learn_alone():
    assert Rendered(LossWeights(semantic=0.0, smoothness=0.0)).without_labels is None
    assert "--losses.semantic 0" in (Rendered().without_labels or "")
    assert Labels().without_labels == Pictures().without_labels == "give --supervision rendered"


@pytest.mark.parametrize(
    ("supervision", "classify_with", "measures"),
    [
        (Rendered(), None, False),
        (Labels(), {"shared": True, "alone": False}, False),
        (Labels(hold_shared=True), {"shared": False, "alone": False}, False),
        (Pictures(), {"shared": True, "alone": True}, True),
        (Pictures(hold_shared=True), {"shared": False, "alone": True}, True),
    ],
    ids=["rendered", "labels", "labels held", "pictures", "pictures held"],
)
def test_a_training_begins_with_all_frozen_that_does_not_learn(supervision, classify_with, measures: bool):
    model = start("small", "random", switches={"semantic_pyramid": (16, 24)})
    state = TrainingState.begin(model, supervision, 1e-3, 0.99)
    everything = {name for name, _ in model.named_parameters()}
    learning = {name for name, parameter in model.named_parameters() if parameter.requires_grad}
    assert learning == (everything if classify_with is None else model.semantic_parameters(**classify_with))
    assert state.supervision is supervision
    norms = [module for module in model.modules() if isinstance(module, nn.BatchNorm2d)]
    assert norms
    assert all(norm.training == measures for norm in norms)
    assert model.training


@pytest.mark.parametrize(
    ("result", "score", "told"),
    [
        (Validation(21.0, 0.25, 0.5, None), 0.25, ["PSNR 21.00 dB", "mIoU 0.250", "accuracy 0.500"]),
        (Validation(21.0, None, None, None), 21.0, ["PSNR 21.00 dB"]),
        (Validation(math.nan, 0.25, 0.5, None), 0.25, ["mIoU 0.250", "accuracy 0.500"]),
    ],
    ids=["rendered", "colour only", "labels"],
)
def test_the_best_is_that_of_mean_iou_or_else_of_psnr(result: Validation, score: float, told: list[str]):
    assert result.score == score
    assert result.told == told
    assert list(result.numbers) == ["psnr", "miou", "accuracy"]


@dataclass(frozen=True)
class Farness(Verdict):
    """A verdict by depth alone: the mean relative error, of which less is better."""

    abs_rel: float
    pictures: np.ndarray | None = None

    @property
    def score(self) -> float:
        return -self.abs_rel

    @property
    def numbers(self) -> dict[str, float | None]:
        return {"abs_rel": self.abs_rel}

    @property
    def told(self) -> list[str]:
        return [f"AbsRel {self.abs_rel:.3f}"]


class Depth(Supervision):
    """A fourth supervision: the depth of the input views, nothing rendered. Its validations say what they are told to."""

    def __init__(self, errors: Sequence[float]) -> None:
        self.errors = iter(errors)

    def loss(self, network: Any, batch: Batch) -> dict[str, Tensor]:
        total = depth_error(network(batch.context).depths, batch.context.depths)
        return dict.fromkeys(TERMS, total.new_zeros(())) | {"total": total, "depth": total.detach()}

    def learning(self, network: Any) -> set[str]:
        return {"layer.weight"}

    def validate(self, network: Any, batches: Sequence[Batch]) -> Verdict:
        return Farness(next(self.errors))

    @property
    def without_labels(self) -> str | None:
        return None


def test_a_fourth_supervision_trains_without_rendering_and_keeps_its_own_best(
    network, batch, settings: TrainingSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("semgs.model.encoding.render", None)
    state = TrainingState.begin(network(), Depth([0.3, 0.1, 0.2, 0.4]), settings.learning_rate, 0.9)
    before = {name: value.clone() for name, value in state.model.named_parameters()}
    first = training_step(state, [batch(0)], settings)
    assert first.total == first.depth > 0
    portions = (Portion((batch(step),)) for step in range(1, 12))
    fit(state, replace(settings, validate_every=3), tmp_path, portions, [batch(1000)])
    moved = {name for name, value in state.model.named_parameters() if (value != before[name]).any()}
    assert moved == {"layer.weight"}
    best = best_checkpoint(tmp_path / "checkpoints")
    assert best is not None
    assert (best.numbers["step"], best.numbers["best_score"]) == (6, -0.1)
    assert '"validation": {"abs_rel": 0.1}' in (tmp_path / "log.jsonl").read_text()
