"""Summaries against loops that read pixels, follow the peers' rules word by word, and know no matrices."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import choose_units, intervals, paired_differences
from semgs.evaluation.scoring.summary import find_extremes, score_classes, summarise
from semgs.objectives.metrics import DepthScores, confusion_matrix

CLASSES = 5
Pixels = list[tuple[int, int]]


def frame(scene: str, pixels: Pixels | None, **scores: object) -> FrameScores:
    """The scores of a target whose (predicted, true) pixels are given."""
    confusion = truth = None
    if pixels is not None:
        predicted, true = (torch.tensor([column], dtype=torch.uint8) for column in zip(*pixels, strict=True))
        confusion = confusion_matrix(predicted, true, CLASSES).numpy()
        truth = np.bincount(true[true != 255].numpy(), minlength=CLASSES)
    return FrameScores(scene, f"{id(pixels)}.png", ("a", "b"), confusion=confusion, truth=truth, **scores)  # type: ignore[arg-type]


def drawn(seed: int, count: int = 60, given: float = 0.8) -> Pixels:
    """Random pixels: class 4 is never true, some are unlabelled, of some no class is given."""
    rng = np.random.default_rng(seed)
    true = rng.integers(0, 4, count)
    true[true == 3] = np.where(seed % 2, 3, 1)
    predicted = np.where(rng.random(count) < 0.5, true, rng.integers(0, CLASSES, count))
    true[rng.random(count) < 0.2] = 255
    predicted[rng.random(count) > given] = 255
    return list(zip(predicted.tolist(), true.tolist(), strict=True))


def by_a_loop(pixels: Pixels) -> tuple[float, float, float]:
    """mIoU, accuracy, class accuracy over the classes that the truth shows before pixels without a prediction are dropped."""
    labelled = [(p, t) for p, t in pixels if t != 255]
    present = sorted({t for _, t in labelled})
    valid = [(p, t) for p, t in labelled if p != 255]
    ious, recalls = [], []
    for label in present:
        hit = sum(p == t == label for p, t in valid)
        union = sum(label in (p, t) for p, t in valid)
        row = sum(t == label for _, t in valid)
        ious.append(hit / union if union else 0.0)
        recalls.append(hit / row if row else 0.0)
    if not present:
        return 0.0, 0.0, 0.0
    right = sum(p == t for p, t in valid)
    return sum(ious) / len(ious), right / len(valid) if valid else 0.0, sum(recalls) / len(recalls)


def test_class_metrics_of_both_kinds_equal_loops_over_pixels():
    sets = {"attic": [drawn(0), drawn(1), drawn(2)], "hall": [drawn(3), [(2, 255)] * 7], "porch": [drawn(5)]}
    found = summarise([frame(scene, pixels) for scene, images in sets.items() for pixels in images])
    everything = [pixel for images in sets.values() for pixels in images for pixel in pixels]
    for name, value in zip(("miou", "accuracy", "class_accuracy"), by_a_loop(everything), strict=True):
        assert found[name] == pytest.approx(value, rel=1e-12)
    scenes = [[by_a_loop(pixels) for pixels in images] for images in sets.values()]
    means = [[sum(column) / len(column) for column in zip(*images, strict=True)] for images in scenes]
    for position, name in enumerate(("miou_per_image", "accuracy_per_image", "class_accuracy_per_image")):
        assert found[name] == pytest.approx(sum(mean[position] for mean in means) / 3, rel=1e-12)
    labelled = [(p, t) for p, t in everything if t != 255]
    assert found["not_given"] == pytest.approx(sum(p == 255 for p, _ in labelled) / len(labelled), rel=1e-12)


def test_the_two_kinds_of_miou_differ_as_they_should():
    # One image is all right, the other has one wrong pixel of a class of its own.
    frames = [frame("a", [(0, 0)] * 99), frame("a", [(0, 1)])]
    found = summarise(frames)
    assert found["miou"] == pytest.approx((99 / 100 + 0) / 2)
    assert found["miou_per_image"] == pytest.approx((1 + 0) / 2)
    assert found["accuracy"] == pytest.approx(0.99)
    assert found["accuracy_per_image"] == pytest.approx(0.5)


def test_images_count_in_their_scene_and_scenes_count_alike():
    frames = [frame("a", [(0, 0)])] + [frame("b", [(0, 1)])] * 3
    assert summarise(frames)["miou_per_image"] == pytest.approx((1 + 0) / 2)


def test_a_class_whose_pixels_have_no_prediction_at_all_counts_as_zero():
    found = summarise([frame("a", [(0, 0), (0, 0), (255, 1)])])
    assert (found["miou"], found["class_accuracy"], found["accuracy"]) == (0.5, 0.5, 1.0)
    assert found["not_given"] == pytest.approx(1 / 3)


def test_scores_per_class_tell_of_absent_and_of_only_predicted_classes():
    wall, floor, cabinet, bed, chair = score_classes([frame("a", [(0, 0), (1, 0), (1, 1), (255, 2), (4, 0)])])
    assert (wall.iou, wall.accuracy, wall.pixels, wall.predicted) == (1 / 3, 1 / 3, 3, 1)
    assert (floor.iou, floor.accuracy) == (1 / 2, 1)
    assert (cabinet.iou, cabinet.accuracy, cabinet.pixels) == (0, 0, 1)
    assert (bed.iou, bed.accuracy, bed.pixels, bed.predicted) == (None, None, 0, 0)
    assert (chair.iou, chair.pixels, chair.predicted) == (None, 0, 1)


def test_pictures_count_alike_and_depth_by_its_pixels():
    frames = [
        frame("a", None, psnr=20.0, ssim=0.5, depth=DepthScores(0.1, 0.9, 300)),
        frame("a", None, psnr=23.0, depth=DepthScores(0.3, 0.5, 100)),
        frame("b", None, psnr=26.0, unseen=0.25),
    ]
    found = summarise(frames)
    assert found["psnr"] == pytest.approx(23)
    assert found["ssim"] == 0.5
    assert found["depth_abs_rel"] == pytest.approx((0.1 * 300 + 0.3 * 100) / 400)
    assert found["depth_delta_125"] == pytest.approx((0.9 * 300 + 0.5 * 100) / 400)
    assert found["unseen"] == 0.25
    assert "miou" not in found
    assert math.isinf(summarise([*frames, frame("b", None, psnr=math.inf)])["psnr"])


def scenes_with(values: list[float]) -> list[FrameScores]:
    """A scene a value, each of two targets with that PSNR."""
    return [frame(f"scene {number}", None, psnr=value) for number, value in enumerate(values) for _ in range(2)]


def test_intervals_are_over_scenes_from_five_on_and_over_frames_below():
    spread = [20.0, 22.0, 24.0, 26.0, 28.0]
    assert choose_units(scenes_with(spread)) == "scenes"
    assert choose_units(scenes_with(spread[:4])) == "frames"
    over_scenes = intervals(scenes_with(spread))["psnr"]
    assert over_scenes.value == pytest.approx(24)
    # The mean of five draws from these values has a standard deviation of 2.83 / sqrt(5) = 1.26.
    assert over_scenes.low == pytest.approx(24 - 1.96 * 1.26, abs=0.35)
    assert over_scenes.high == pytest.approx(24 + 1.96 * 1.26, abs=0.35)
    # Ten draws of frames: 2.83 / sqrt(10) = 0.89.
    over_frames = intervals([frame("one", None, psnr=value) for value in spread for _ in range(2)])["psnr"]
    assert over_frames.high - over_frames.low == pytest.approx(2 * 1.96 * 0.89, abs=0.4)


def test_the_interval_of_miou_is_of_matrices_of_drawn_scenes_and_repeats_to_the_bit():
    frames = [frame(f"scene {seed}", drawn(seed, given=0.9)) for seed in range(6)]
    first, second = intervals(frames), intervals(frames)
    assert first == second
    rng = np.random.default_rng(1)
    trials = [summarise([frames[index] for index in rng.integers(0, 6, 6)])["miou"] for _ in range(150)]
    low, high = np.percentile(trials, (2.5, 97.5))
    assert first["miou"].low == pytest.approx(low, abs=0.04)
    assert first["miou"].high == pytest.approx(high, abs=0.04)


def test_a_scene_that_is_drawn_twice_counts_twice_in_means_over_scenes():
    frames = [frame(f"scene {number}", [(0, number % 2)]) for number in range(5)]
    interval = intervals(frames)["miou_per_image"]
    assert interval.value == pytest.approx(3 / 5)
    # Means of five draws are multiples of a fifth.
    assert 5 * interval.low == pytest.approx(round(5 * interval.low))
    assert interval.low < 3 / 5 < interval.high


def test_one_frame_has_no_interval_and_equal_ones_a_narrow_one():
    assert intervals([frame("a", [(0, 0), (1, 0)])]) == {}
    same = intervals([frame("a", [(0, 0), (1, 0)])] * 3)["accuracy"]
    assert (same.low, same.value, same.high) == (0.5, 0.5, 0.5)


def test_a_paired_difference_is_far_surer_than_the_two_intervals():
    rng = np.random.default_rng(4)
    hard = rng.uniform(15, 30, 12)
    first = [frame("a", None, psnr=float(value)) for value in hard]
    second = [frame("a", None, psnr=float(value) + 0.5 + 0.1 * rng.standard_normal()) for value in hard]
    for one, other in zip(first, second, strict=True):
        object.__setattr__(other, "target", one.target)
    difference = paired_differences(first, second)["psnr"]
    assert 0.3 < difference.low < difference.value < difference.high < 0.7
    wide = intervals(first)["psnr"]
    assert wide.high - wide.low > 10 * (difference.high - difference.low)
    swapped = paired_differences(second, first)["psnr"]
    assert (swapped.low, swapped.high) == pytest.approx((-difference.high, -difference.low))
    with pytest.raises(ValueError, match="different targets"):
        paired_differences(first, second[1:])


def test_the_best_and_the_worst_frames_are_those_of_a_sorted_list_whenever_they_come():
    """Of 30 PSNR that are told one after the other, where the list is cut to its ends after each."""
    values = np.random.default_rng(5).permutation(30)
    frames = [frame("attic", None, psnr=float(value)) for value in values]
    best, worst = find_extremes(frames, 4)
    assert [values[place] for place in best] == [29, 28, 27, 26]
    assert [values[place] for place in worst] == [0, 1, 2, 3]
    kept: list[FrameScores] = []
    for one in frames:
        kept.append(one)
        best, worst = find_extremes(kept, 4)
        kept = [kept[place] for place in sorted([*best, *worst])]
    assert {one.psnr for one in kept} == {0, 1, 2, 3, 26, 27, 28, 29}


def test_few_frames_are_best_or_worst_never_both_and_equal_pictures_have_no_place():
    frames = [frame("attic", None, psnr=value) for value in (20.0, math.inf, 10.0, 30.0)]
    assert find_extremes(frames, 10) == ([3, 0], [2])
    scored = frame("attic", [(1, 1)], psnr=1.0)
    assert find_extremes([*frames, scored], 10) == ([4], []), (
        "where classes are scored, frames without them have no place"
    )
