"""What each supervision learns from."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from networks import network as network_of
from networks import preset
from posed import posed_views
from torch import nn

from semgs.data.views import Batch, Views, stack
from semgs.files.errors import InputError
from semgs.files.images.colours import NOTHING
from semgs.model.classes.semantic import ClassMaps
from semgs.model.weights.initial_weights import initial_network
from semgs.objectives.loss_weights import DepthLossWeights, LossWeights
from semgs.objectives.losses import losses
from semgs.scene.coarse_depth import CoarseDepth, FinerDepth
from semgs.training.data.batches import Portion
from semgs.training.loop import Feed, fit
from semgs.training.run.checkpoints import best_checkpoint, newest_checkpoint
from semgs.training.run.session import Session
from semgs.training.schedule import Rates, relative_rates, what_learns
from semgs.training.state import TrainingState, training_step
from semgs.training.supervision.supervision import (
    TERMS,
    Depth,
    Labels,
    Objective,
    Pictures,
    Rendered,
    Supervision,
    make_supervision,
    render_targets,
)
from semgs.training.supervision.supervision_settings import SupervisionSettings
from semgs.training.supervision.validation import Validation, validation_of_depth, validation_of_views
from semgs.training.training_settings import TrainingSettings


class Deep(nn.Module):
    """Finds depths that are the true ones times a factor, or each view's times its own, undecided between two candidates."""

    def __init__(self, *factors: float) -> None:
        super().__init__()
        self.factors = torch.tensor(factors)[:, None, None]

    def sweep(self, views: Views) -> CoarseDepth:
        leading, (height, width) = views.images.shape[:-3], views.size
        halves = torch.full((*leading, 2, height // 4, width // 4), 0.5)
        return CoarseDepth(
            self.factors * views.depths.clamp(min=1), halves, views.depth_range.flip(-1).float(), "inverse"
        )


class Undecided(nn.Module):
    """Gives every class of every pixel the same probability, and keeps what it was asked."""

    stride = 2

    def class_maps(self, views: Views, alone: bool = False) -> ClassMaps:
        self.asked = (len(views), alone)
        height, width = views.size
        return ClassMaps(torch.full((*views.images.shape[:-3], 20, height // 2, width // 2), 1 / 20), None)


def test_the_settings_name_one_of_four(settings):
    weights = (2.0,) * 20
    assert make_supervision(settings, weights) == Rendered(LossWeights(0.5, 1.0, 0.1), weights, 0.1, True)
    assert make_supervision(replace(settings, supervision="labels"), weights) == Labels(
        weights, LossWeights(0.5, 1.0, 0.1)
    )
    taught = replace(settings, supervision="pictures", teacher_weight=2.0)
    assert make_supervision(taught, weights, 7) == Pictures(weights, 7, 2.0)
    assert make_supervision(replace(settings, supervision="depth"), weights) == Depth(DepthLossWeights(1.3, 0.5, 0.1))


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


COLOUR = LossWeights(semantic=0.0, smoothness=0.0)
"""Weights of a loss that does not depend on classes."""


class Striped:
    """Is sure of class 1 in every other column of Gaussians, with probabilities 0.6 and 0.2 in turns."""

    stride = 2

    def class_maps(self, views: Views, alone: bool = False) -> ClassMaps:
        height, width = views.size
        maps = torch.full((*views.images.shape[:-3], 20, height // 2, width // 2), 0.4 / 19)
        maps[..., 1, :, ::2], maps[..., 1, :, 1::2] = 0.6, 0.2
        return ClassMaps(maps, None)


def test_the_smoothness_of_labelled_views_is_that_of_the_map_at_their_pixels(batch):
    """All pixels are of class 1. At each of 11 borders between columns of Gaussians, 16 pixels differ by 0.4 from their right neighbour:
    70.4 in sum, over 384 pixels 0.1833."""
    one = batch(0)
    one.context.labels[:] = 1
    assert one.context.size == (16, 24)
    plain = Objective(Striped(), Labels(losses=LossWeights(0.1, 1.0, 0.0)))(one)
    mean = Objective(Striped(), Labels(losses=LossWeights(0.1, 1.0, 0.001)))(one)
    total = Objective(Striped(), Labels(losses=LossWeights(0.1, 1.0, 0.001, smoothness_over="sum")))(one)
    entropy = -(math.log(0.6) + math.log(0.2)) / 2
    assert float(plain["total"]) == pytest.approx(entropy, rel=1e-5)
    assert float(mean["smoothness"]) == pytest.approx(70.4 / 384, rel=1e-5)
    assert float(mean["total"]) == pytest.approx(entropy + 0.01 * 70.4 / 384, rel=1e-6)
    assert float(total["total"]) == pytest.approx(entropy + 0.704, rel=1e-5)
    with pytest.raises(ValueError, match="losses"):
        SupervisionSettings(supervision="labels", losses=LossWeights(semantic=0.0))


@pytest.mark.parametrize("supervision", [Labels(), Pictures()], ids=["labels", "pictures"])
def test_views_without_labels_are_refused_by_name(batch, supervision: Supervision):
    one = batch(0)
    bare = Batch(replace(one.context, labels=None), replace(one.target, labels=None), one.scenes)
    with pytest.raises(ValueError, match=f"supervision by {type(supervision).__name__.lower()} needs them"):
        supervision.loss(Undecided(), bare)


def test_depths_that_are_all_too_large_by_a_factor_lose_its_logarithm(batch):
    one = batch(0)
    one.context.depths[0, 0] = 0  # one of four views without depth, whose share of the mean is zero
    terms = Objective(Deep(1.5), Depth())(one)
    assert set(terms) == set(TERMS)
    assert float(terms["depth"]) == pytest.approx(0.75 * math.log(1.5), rel=1e-5)
    assert float(terms["gradients"]) == pytest.approx(0, abs=1e-5)
    assert float(terms["distribution"]) == pytest.approx(0.75 * math.log(2), rel=1e-5)
    total = 1.3 * float(terms["depth"]) + 0.1 * float(terms["distribution"])
    assert float(terms["total"]) == pytest.approx(total, rel=1e-5)
    assert float(terms["semantic"]) == float(terms["colour"]) == float(terms["smoothness"]) == 0
    assert math.isnan(float(terms["psnr"]))
    weighted = Objective(Deep(1.5), Depth(DepthLossWeights(1.0, 1.0, 0.0)))(one)
    assert float(weighted["total"]) == pytest.approx(float(terms["depth"]), rel=1e-4)
    with pytest.raises(ValueError, match="the scenes have no depth; supervision by depth needs it"):
        Objective(Deep(1.5), Depth())(Batch(replace(one.context, depths=None), one.target, one.scenes))


def test_a_validation_of_depth_has_the_errors_of_all_pixels_with_depth_together(batch):
    batches = [batch(step, scenes=1) for step in range(3)]
    for one in batches:
        one.context.depths[0, 0, :8] = 0  # of the first view, 8 of 16 rows
    result = Depth().validate(Deep(1.1, 2.0), batches)
    assert result.numbers["depth_abs_rel"] == pytest.approx((0.1 + 2 * 1.0) / 3, rel=1e-5)
    assert result.numbers["depth_delta_125"] == pytest.approx(1 / 3)
    assert result.score == -result.numbers["depth_abs_rel"]
    assert list(result.phrases) == ["AbsRel 0.7000", "delta < 1.25 0.333"]
    assert result.pictures.shape == (3 * 16, 3 * 24, 3)


def test_the_strip_of_depth_shows_image_depth_and_truth(batch):
    one = batch(0, scenes=1)
    one.context.depths[0, 0, :8] = 0
    image, depth, truth = np.split(Depth().validate(Deep(1.0), [one]).pictures, 3, axis=1)
    assert np.array_equal(image, np.rint(255 * one.context.images[0, 0].permute(1, 2, 0).numpy()))
    assert np.array_equal(depth[8:], truth[8:])
    assert (truth[:8] == NOTHING).all()


def test_without_true_depth_a_validation_of_depth_has_no_score(batch):
    one = batch(0)
    one.context.depths[:] = 0
    for result in (Depth().validate(Deep(1.0), [one]), Depth().validate(Deep(1.0), [])):
        assert math.isnan(result.score)
        assert math.isnan(result.numbers["depth_delta_125"])


def test_scenes_without_labels_will_do_only_where_colour_and_depth_learn_alone():
    assert SupervisionSettings(losses=LossWeights(semantic=0.0, smoothness=0.0)).without_labels is None
    assert "--losses.semantic 0" in (SupervisionSettings().without_labels or "")
    for kind in ("labels", "pictures"):
        assert SupervisionSettings(supervision=kind).without_labels == "give --supervision rendered"
    assert SupervisionSettings(supervision="depth").without_labels is None


def test_scenes_without_depth_will_do_for_all_but_depth():
    for kind in ("rendered", "labels", "pictures"):
        assert SupervisionSettings(supervision=kind, depth_weight=0.1).without_depth is None
    assert "leave them out" in (SupervisionSettings(supervision="depth").without_depth or "")


@pytest.mark.parametrize(
    ("supervision", "shared_rate", "classify_with", "measures"),
    [
        (Rendered(), 1.0, None, False),
        (Labels(), 1.0, {"shared": True, "alone": False}, False),
        (Labels(), 0.0, {"shared": False, "alone": False}, False),
        (Pictures(), 1.0, {"shared": True, "alone": True}, True),
        (Pictures(), 0.0, {"shared": False, "alone": True}, True),
    ],
    ids=["rendered", "labels", "labels held", "pictures", "pictures held"],
)
@pytest.mark.parametrize("backbone", [False, True], ids=["blocks", "backbone"])
def test_a_training_begins_with_all_frozen_that_does_not_learn(
    supervision, shared_rate: float, classify_with, measures: bool, backbone: bool
):
    model = initial_network("small_plain", "random", switches={"class_backbone": backbone})
    rates = relative_rates(model, Rates(shared_rate=shared_rate))
    state = TrainingState.begin(model, supervision, 1e-3, 0.99, rates=rates)
    everything = {name for name, _ in model.named_parameters()}
    learning = {name for name, parameter in model.named_parameters() if parameter.requires_grad}
    assert learning == (everything if classify_with is None else model.semantic_parameters(**classify_with))
    assert state.supervision is supervision
    norms = [module for module in model.modules() if isinstance(module, nn.BatchNorm2d)]
    assert bool(norms) == backbone
    assert all(norm.training == measures for norm in norms)
    assert model.training


@pytest.mark.parametrize(
    ("result", "score", "told"),
    [
        (validation_of_views(21.0, 0.25, 0.5, None), 0.25, ["PSNR 21.00 dB", "mIoU 0.250", "accuracy 0.500"]),
        (validation_of_views(21.0, None, None, None), 21.0, ["PSNR 21.00 dB"]),
        (validation_of_views(math.nan, 0.25, 0.5, None), 0.25, ["mIoU 0.250", "accuracy 0.500"]),
    ],
    ids=["rendered", "colour only", "labels"],
)
def test_the_best_is_that_of_mean_iou_or_else_of_psnr(result: Validation, score: float, told: list[str]):
    assert result.score == score
    assert list(result.phrases) == told
    assert list(result.numbers) == ["psnr", "miou", "accuracy"]


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("own", [False, True], ids=["shared", "own"])
def test_every_parameter_that_learns_by_depth_gets_a_gradient_and_no_other(held: bool, own: bool):
    """Processes that share a step wait for the gradient of each parameter that learns."""
    model = network_of(channels=16, cnn_widths=(8, 8, 16), candidates=8, semantic_blocks=1, colour_blocks=1,
                       cost_width=16, upsampled_channels=16, harmonics=4, shared_layers=not own)  # fmt: skip
    rates = relative_rates(model, Rates(shared_rate=0.0 if held else 1.0))
    state = TrainingState.begin(model, Depth(), 1e-3, 0.99, rates=rates)
    views = replace(posed_views(2, (16, 32)), depths=torch.full((2, 16, 32), 2.0))
    state.objective(Batch(views, views, ("a",)))["total"].backward()
    reached = {name for name, one in model.named_parameters() if one.grad is not None}
    assert reached == {name for name, one in model.named_parameters() if one.requires_grad}
    assert any(name.startswith("cnn.") for name in reached) == (own or not held)


@pytest.mark.usefixtures("real_rendering")
@pytest.mark.parametrize("backbone", [False, True], ids=["blocks", "backbone"])
def test_without_weights_for_classes_they_are_not_rendered_and_all_but_their_branch_learns(backbone: bool):
    """The loss and its gradients are those of a loss in which classes count for nothing, to the bit."""
    model = initial_network("small_plain", "random", switches={"class_backbone": backbone, "depth_cue": backbone})
    TrainingState.begin(model, Rendered(COLOUR), 1e-3, 0.99)
    views = stack([posed_views(2, (16, 32))])
    batch = Batch(views, views, ("a",))
    found = Objective(model, Rendered(COLOUR))(batch)
    found["total"].backward()
    gradients = {name: one.grad for name, one in model.named_parameters() if one.grad is not None}
    assert set(gradients) == {name for name, one in model.named_parameters() if one.requires_grad}
    assert set(gradients) == {name for name, _ in model.named_parameters() if not name.startswith("semantic.")}
    assert float(found["semantic"]) == 0
    model.zero_grad()
    encoding = model(views)
    rendering = encoding.render(views.cameras, clamp=False)
    assert rendering.semantics is not None
    (error := (rendering.images - views.images).square().mean()).backward()
    assert float(error.detach()) == float(found["total"].detach())
    for name, one in model.named_parameters():
        assert name not in gradients or torch.equal(one.grad, gradients[name])


@pytest.mark.parametrize("sweep_rate", [0.0, 1.0])
def test_every_parameter_that_learns_sharp_depth_gets_a_gradient_and_no_other(sweep_rate: float):
    model = preset("small_plain", depth_upsampling="convex")
    torch.nn.init.normal_(model.colour.heads.convex.layers[-1].weight)
    supervision = Depth(DepthLossWeights(sharp=1.0))
    state = TrainingState.begin(
        model, supervision, 1e-3, 0.99, rates=relative_rates(model, Rates(sweep_rate=sweep_rate))
    )
    views = replace(posed_views(2, (16, 32)), depths=torch.full((2, 16, 32), 2.0))
    state.objective(Batch(views, views, ("a",)))["total"].backward()
    reached = {name for name, one in model.named_parameters() if one.grad is not None}
    assert reached == {name for name, one in model.named_parameters() if one.requires_grad}
    assert reached == model.upsampling_parameters() | (model.depth_parameters() if sweep_rate else set())


def test_a_loss_of_sharp_depth_needs_convex_upsampling():
    with pytest.raises(InputError, match=r"give --network\.depth-upsampling convex as well"):
        Depth(DepthLossWeights(sharp=1.0)).learning(preset("small_plain"))


def test_a_validation_of_sharp_depth_scores_the_depth_after_upsampling(batch):
    class Sharp(Deep):
        def sweep(self, views: Views) -> CoarseDepth:
            coarse = super().sweep(views)
            return replace(coarse, finer=FinerDepth(2 * coarse.depths, views.depths * 1.25))

    result = Depth().validate(Sharp(1.1), [batch(0, scenes=1)])
    assert result.numbers["depth_abs_rel"] == pytest.approx(0.25, rel=1e-5)


def test_supervision_by_depth_trains_without_rendering_and_keeps_the_validation_of_least_error(
    sweeping, batch, settings: TrainingSettings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("semgs.scene.encoding.render", None)
    errors = iter([0.3, 0.1, 0.2, 0.4])
    monkeypatch.setattr(
        "semgs.training.supervision.supervision.validate_depth",
        lambda *given: validation_of_depth(next(errors), 0.5, None),
    )
    state = TrainingState.begin(sweeping(), Depth(), settings.learning_rate, 0.9, rates={"layer.bias": 0.0})
    before = {name: value.clone() for name, value in state.model.named_parameters()}
    first = training_step(state, [batch(0)], settings)
    assert first.total == pytest.approx(1.3 * first.depth + 0.5 * first.gradients + 0.1 * first.distribution, rel=1e-5)
    assert min(first.depth, first.gradients, first.distribution) > 0
    portions = (Portion((batch(step),)) for step in range(1, 12))
    fit(state, settings, tmp_path, Feed(portions, [batch(1000)]), Session(), validate_every=3)
    moved = {name for name, value in state.model.named_parameters() if (value != before[name]).any()}
    assert moved == {"layer.weight"}
    newest = newest_checkpoint(tmp_path / "checkpoints")
    assert newest is not None
    best = best_checkpoint(tmp_path / "checkpoints", newest)
    assert best is not None
    assert (best.numbers["step"], best.numbers["best_score"]) == (6, -0.1)
    log = (tmp_path / "log.jsonl").read_text()
    assert '"validation": {"depth_abs_rel": 0.1, "depth_delta_125": 0.5}' in log
    assert '"gradients"' in log


def test_a_pixel_that_is_too_bright_is_compared_as_bright_as_it_is(network, batch):
    """Colour 1.5 everywhere against 0: a mean square of 2.25, which a clamp would make 1."""
    step = batch(0)
    encoding = network()(step.context)
    bright = replace(encoding.gaussians.colour, features=torch.ones_like(encoding.gaussians.colour.features))
    encoding = replace(encoding, gaussians=replace(encoding.gaussians, colour=bright))
    step = replace(step, target=step.target.changed(images=torch.zeros_like(step.target.images)))
    rendering, target = render_targets(encoding, step)
    assert losses(rendering, target, LossWeights()).colour.item() == pytest.approx(2.25)


def test_rates_are_shares_of_the_setting_by_what_the_parameters_are_for():
    model = preset("small_plain", class_backbone=True)
    settings = TrainingSettings(model="small_plain", steps=1, class_rate=0.5, sweep_rate=0.25, backbone_rate=0.1)
    shares = relative_rates(model, settings)
    assert {shares[name] for name in model.pretrained_parameters()} == {0.05}
    assert {shares[name] for name in model.depth_parameters()} == {0.25}
    for name, expected in {
        "semantic.refinement.classifier.weight": 0.5, "semantic.head.2.weight": 1.0, "colour.heads.colour.2.weight": 1.0,
        "colour.heads.refinement.to_disparity.2.weight": 1.0, "cnn.conv1.weight": 0.25,
    }.items():  # fmt: skip
        assert shares.get(name, 1.0) == expected
        assert name in dict(model.named_parameters())
    plain = TrainingSettings(model="small_plain", steps=1)
    assert relative_rates(preset("small_plain"), plain) == {}, "the paper's network learns at one rate"


@pytest.mark.parametrize(
    ("supervision", "rates", "told"),
    [
        (Rendered(), {}, "learns: shared, depth, colour, semantic, classes"),
        (Rendered(COLOUR), {}, "learns: shared, depth, colour; keeps its weights: semantic, classes"),
        (Depth(), {}, "learns: shared, part of depth; keeps its weights: colour, semantic, classes"),
        (Labels(), {"shared_rate": 0.0}, "learns: semantic, classes; keeps its weights: shared, depth, colour"),
    ],
)
def test_it_is_told_which_parts_learn(supervision: Supervision, rates: dict[str, float], told: str):
    model = preset("small_plain")
    TrainingState.begin(model, supervision, 1e-3, 0.99, rates=relative_rates(model, Rates(**rates)))
    assert what_learns(model) == told


@pytest.mark.parametrize(
    ("shared_rate", "told"),
    [(0.0, "learns: part of semantic with MOSAIC, part of classes; keeps its weights: shared with the class backbone, depth, colour"),
     (1.0, "learns: shared with the class backbone, part of semantic with MOSAIC, part of classes; keeps its weights: depth, colour")],
)  # fmt: skip
def test_it_is_told_that_a_backbone_that_gives_depth_its_cues_is_shared(shared_rate: float, told: str):
    """With --shared-rate 0, only the decoder behind the backbone learns, whatever --backbone-rate is."""
    model = initial_network("small", "small")
    rates = relative_rates(model, Rates(backbone_rate=0.3, shared_rate=shared_rate))
    TrainingState.begin(model, Pictures(), 1e-3, 0.99, rates=rates)
    assert what_learns(model) == told


def test_the_rate_of_the_upsampling_is_its_own():
    model = preset("small_plain", depth_upsampling="convex")
    shares = relative_rates(model, Rates(upsampling_rate=0.5, sweep_rate=0.25))
    assert {shares[name] for name in model.upsampling_parameters()} == {0.5}
    sharp = DepthLossWeights(sharp=1.0)
    TrainingSettings(model="small_plain", steps=1, supervision="depth", sweep_rate=0.0, depth_losses=sharp)
    with pytest.raises(ValueError, match="sweep_rate is 0"):
        TrainingSettings(
            model="small_plain", steps=1, supervision="depth", sweep_rate=0.0, upsampling_rate=0.0, depth_losses=sharp
        )


def test_a_rate_of_zero_freezes_what_it_is_for_and_nothing_else():
    model = preset("small_plain", class_backbone=True)
    settings = TrainingSettings(model="small_plain", steps=10, class_rate=0.0, sweep_rate=0.5)
    state = TrainingState.begin(model, make_supervision(settings), 1e-3, 0.9, rates=relative_rates(model, settings))
    frozen = {name for name, one in model.named_parameters() if not one.requires_grad}
    refinement = {name for name in frozen if name.startswith("semantic.refinement.")}
    assert frozen == refinement
    assert {name.split(".")[2] for name in frozen} == {"backbone", "lateral", "merged", "last", "classifier"}
    assert sorted(group["relative_rate"] for group in state.optimizer.param_groups) == [0, 0.5, 1]


@pytest.mark.parametrize(
    ("name", "supervision"), [("sweep_rate", "depth"), ("class_rate", "pictures"), ("class_rate", "labels")]
)
def test_a_rate_of_zero_that_would_leave_nothing_to_learn_is_refused(name: str, supervision: str):
    with pytest.raises(ValueError, match=f"{name} is 0.*above 0 with supervision by"):
        TrainingSettings(model="small_plain", steps=1, supervision=supervision, **{name: 0.0})
