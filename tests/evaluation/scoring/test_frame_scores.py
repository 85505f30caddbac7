"""Scores of single targets against loops over their pixels."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.predictions import Prediction
from semgs.evaluation.frames.protocols import TargetSample
from semgs.evaluation.frames.reading import read_frame
from semgs.evaluation.scoring.frame_scores import score, ssim
from semgs.evaluation.scoring.score_records import decode_scores, encode_scores
from semgs.evaluation.scoring.summary import summarise
from semgs.objectives.metrics import depth_scores, mean_scores
from semgs.rendering.rendering import Rendering, likeliest
from semgs.run.steps.finishing import scores

MakeScene = Callable[..., Scene]


@pytest.fixture
def target(make_scene: MakeScene) -> tuple[Task, Views]:
    task = Task(make_scene(), (36, 48), TargetSample((0, 2), 1))
    return task, read_frame(task, 1, (0.5, 10.0))


def test_pixels_without_a_prediction_enter_no_confusion_matrix_and_their_truth_is_still_counted(
    target: tuple[Task, Views],
):
    task, truth = target
    assert truth.labels is not None
    generator = torch.Generator().manual_seed(3)
    labels = torch.randint(0, 6, (36, 48), generator=generator).byte()
    labels[torch.rand(36, 48, generator=generator) < 0.3] = 255
    found = score(task, Prediction(labels=labels), truth)
    expected = np.zeros((20, 20), int)
    counts = np.zeros(20, int)
    for given, true in zip(labels.flatten().tolist(), truth.labels.flatten().tolist(), strict=True):
        if true != 255:
            counts[true] += 1
            if given != 255:
                expected[true, given] += 1
    assert found.confusion is not None
    assert found.truth is not None
    assert (found.confusion == expected).all()
    assert (found.truth == counts).all()
    assert 0 < expected.sum() < counts.sum()


def test_only_labelled_and_seen_pixels_count_for_the_confidence(target: tuple[Task, Views]):
    """In every second column the class is right, with 0.9; elsewhere it is wrong, with 0.6. The first 5 rows are unseen."""
    task, truth = target
    assert truth.labels is not None
    true = truth.labels[0]
    labels, confidence = true.clone(), torch.full((36, 48), 0.9)
    labels[:, 1::2], confidence[:, 1::2] = 19, 0.6
    confidence[:5] = 0
    found = score(task, Prediction(labels=labels, confidences=confidence), truth).confidences
    assert found is not None
    counted = (true != 255)[5:]
    sure, unsure = int(counted[:, ::2].sum()), int(counted[:, 1::2].sum())
    assert found[found[:, 0] > 0].tolist() == [[unsure, int((true[5:, 1::2] == 19).sum())], [sure, sure]]
    assert sure > 100
    assert score(task, Prediction(labels=labels), truth).confidences is None


def test_what_is_missing_has_no_score(target: tuple[Task, Views]):
    task, truth = target
    nothing = score(task, Prediction(), truth)
    assert (nothing.confusion, nothing.psnr, nothing.ssim, nothing.depth, nothing.unseen) == (None,) * 5
    assert (nothing.scene, nothing.target, nothing.contexts) == (
        "living",
        "images/001.png",
        ("images/000.png", "images/002.png"),
    )
    bare = Views(truth.images, truth.cameras, truth.depth_range)
    assert truth.labels is not None
    unknown = score(task, Prediction(labels=truth.labels[0], depths=torch.ones(36, 48)), bare)
    assert (unknown.confusion, unknown.truth, unknown.depth) == (None, None, None)


def test_scores_over_the_seen_pixels_leave_the_others_out(target: tuple[Task, Views]):
    """The upper half is seen and right, but for a picture that is 0.1 too bright (20 dB); the lower half is black, nearby and class 0."""
    task, truth = target
    assert truth.labels is not None
    assert truth.depths is not None
    lower = torch.arange(36)[:, None].expand(36, 48) >= 18
    view = truth.changed(images=truth.images.clamp(0, 0.8))
    prediction = Prediction(
        labels=torch.where(lower, 0, truth.labels[0]).byte(),
        image=torch.where(lower, 0, view.images[0] + 0.1),
        depths=torch.where(lower, 0, 1.5 * truth.depths[0]),
        unseen=lower,
    )
    found = score(task, prediction, view)
    assert (found.unseen, found.miou_seen, found.accuracy_seen) == (0.5, 1, 1)
    assert found.psnr_seen == pytest.approx(20, abs=1e-4)
    assert found.psnr is not None
    assert found.psnr < 12
    assert found.depth_seen is not None
    assert found.depth is not None
    assert (found.depth_seen.abs_rel, found.depth_seen.pixels) == (pytest.approx(0.5), 18 * 48)
    assert found.depth.abs_rel == pytest.approx(0.75)
    assert vars(decode_scores(encode_scores(found), 20).depth_seen) == vars(found.depth_seen)
    assert summarise([found])["depth_abs_rel_seen"] == pytest.approx(0.5)
    silent = score(task, replace(prediction, unseen=None), view)
    assert (silent.psnr_seen, silent.miou_seen, silent.accuracy_seen, silent.depth_seen) == (None,) * 4


def test_the_truth_itself_is_perfect(target: tuple[Task, Views]):
    task, truth = target
    assert truth.labels is not None
    assert truth.depths is not None
    perfect = score(task, Prediction(truth.labels[0], truth.images[0], truth.depths[0]), truth)
    assert perfect.confusion is not None
    assert perfect.confusion.trace() == perfect.confusion.sum() > 1000
    assert perfect.psnr == math.inf
    assert perfect.ssim == pytest.approx(1, abs=1e-6)
    assert perfect.depth is not None
    assert (perfect.depth.abs_rel, perfect.depth.delta, perfect.depth.pixels) == (0, 1, 36 * 48)


def test_depth_counts_every_pixel_with_truth_also_those_where_nothing_was_drawn():
    truth = torch.tensor([[2.0, 4.0, 0.0], [1.0, 2.0, 5.0]])
    depths = torch.tensor([[2.2, 0.0, 3.0], [1.0, 2.5, 4.0]])
    found = depth_scores(depths, truth)
    assert found is not None
    assert found.abs_rel == pytest.approx((0.1 + 1 + 0 + 0.25 + 0.2) / 5, rel=1e-6)
    # A factor of exactly 1.25 is not within it.
    assert (found.delta, found.pixels) == (2 / 5, 5)
    assert depth_scores(depths, torch.zeros(2, 3)) is None


def test_ssim_equals_a_loop_over_the_windows_of_all_pixels():
    generator = torch.Generator().manual_seed(0)
    truth = torch.rand(3, 13, 15, generator=generator, dtype=torch.float64)
    image = (truth + 0.2 * torch.randn(3, 13, 15, generator=generator, dtype=torch.float64)).clamp(-0.2, 1.2)
    offsets = np.arange(11) - 5
    window = np.exp(-(offsets[:, None] ** 2 + offsets**2) / (2 * 1.5**2))
    window /= window.sum()
    values = []
    for channel in range(3):
        x, y = (np.pad(one[channel].numpy(), 5, mode="reflect") for one in (image.clamp(0, 1), truth))
        for row in range(13):
            for column in range(15):
                a, b = x[row : row + 11, column : column + 11], y[row : row + 11, column : column + 11]
                mean_a, mean_b = (window * a).sum(), (window * b).sum()
                var_a, var_b = (window * a * a).sum() - mean_a**2, (window * b * b).sum() - mean_b**2
                both = (window * a * b).sum() - mean_a * mean_b
                values.append(
                    (2 * mean_a * mean_b + 1e-4) * (2 * both + 9e-4)
                    / ((mean_a**2 + mean_b**2 + 1e-4) * (var_a + var_b + 9e-4))
                )  # fmt: skip
    assert ssim(image, truth) == pytest.approx(np.mean(values), abs=1e-6)


def test_a_reconstruction_and_an_evaluation_give_one_number_for_one_measure(make_scene: MakeScene):
    """Two targets, of one of which only a tenth has a true depth: a mean over views would not be one over pixels."""
    opened = make_scene()
    tasks = [Task(opened, (36, 48), TargetSample((0, 3), position)) for position in (1, 2)]
    generator = torch.Generator().manual_seed(5)
    shown, frames = [], []
    for task in tasks:
        truth = read_frame(task, task.sample.target, (0.5, 10.0))
        assert truth.depths is not None
        if task is tasks[1]:
            truth = truth.changed(depths=truth.depths * (torch.rand(1, 36, 48, generator=generator) < 0.1))
        assert truth.depths is not None
        rendering = Rendering(
            images=torch.rand(1, 3, 36, 48, generator=generator),
            semantics=torch.rand(1, 20, 36, 48, generator=generator),
            depths=truth.depths + torch.rand(1, 36, 48, generator=generator),
            alphas=torch.rand(1, 36, 48, generator=generator),
        )
        assert rendering.semantics is not None
        prediction = Prediction(
            labels=likeliest(rendering.semantics[0]),
            image=rendering.images[0],
            depths=rendering.depths[0],
            unseen=rendering.alphas[0] < 0.5,
        )
        shown += scores(rendering, truth)
        frames.append(score(task, prediction, truth))
    reconstructed, evaluated = mean_scores(shown).by_measure, summarise(frames)
    assert len(reconstructed) == 9
    assert reconstructed == pytest.approx({name: evaluated[name] for name in reconstructed}, rel=1e-5)


def test_hidden_pixels_of_the_truth_count_in_no_score(target: tuple[Task, Views]):
    """The prediction is off by 0.1 at visible pixels, 20 dB, and wrong in every way at hidden ones."""
    task, truth = target
    hidden = torch.zeros(1, *truth.size, dtype=torch.bool)
    hidden[0, :, :7] = True
    truth = truth.changed(images=truth.images.clamp(0.2, 0.8))
    labels, depths = truth.labels.masked_fill(hidden, 255), truth.depths.masked_fill(hidden, 0)
    image = truth.images[0] + 0.1
    image[:, hidden[0]] = 0
    prediction = Prediction(
        labels=torch.zeros_like(labels[0]), image=image, depths=1.5 * truth.depths[0], unseen=hidden[0]
    )
    found = score(task, prediction, truth.changed(labels=labels, depths=depths, hidden=hidden))
    assert found.psnr == pytest.approx(20, abs=1e-4)
    assert found.unseen == 0
    assert found.hidden == 7 * truth.size[0]
    assert found.depth.pixels == int((depths > 0).sum())
    assert found.truth.sum() == int((labels != 255).sum())


def test_the_similarity_leaves_out_the_windows_around_hidden_pixels(target: tuple[Task, Views]):
    """Where only hidden pixels differ, a visible pixel may count less only if its window of 11x11 reaches them; with their truth it never does."""
    task, truth = target
    hidden = torch.zeros(1, *truth.size, dtype=torch.bool)
    hidden[0, :, :7] = True
    image = truth.images[0].masked_fill(hidden, 0)
    assert score(task, Prediction(image=image), truth.changed(hidden=hidden)).ssim == pytest.approx(1)
    assert score(task, Prediction(image=image), truth).ssim < 0.95
    shown = ~hidden[0]
    noisy = (
        truth.images[0] + 0.1 * torch.rand(truth.images[0].shape, generator=torch.Generator().manual_seed(1))
    ).clamp(0, 1)
    whole, part = ssim(noisy, truth.images[0]), ssim(noisy, truth.images[0], shown)
    rest = ssim(noisy, truth.images[0], ~shown)
    share = shown.double().mean().item()
    assert share * part + (1 - share) * rest == pytest.approx(whole, abs=1e-5)
