"""Metrics against a loop over pixels that follows the peers' rules word by word."""

from __future__ import annotations

import math

import pytest
import torch
from torchmetrics.functional.classification import multiclass_confusion_matrix

from semgs.data.tables.classes import IGNORE
from semgs.objectives.metrics import (
    accuracy,
    class_accuracy,
    confusion_matrix,
    intersection_over_union,
    miou,
    present_classes,
    psnr,
)

CLASSES = 5


def label_maps(seed: int, images: int = 4) -> tuple[torch.Tensor, torch.Tensor]:
    """Random predictions and truths.

    Class 4 is never true but predicted, image 1 shows only classes 0 and 1, image 3 has no valid pixel, some true pixels
    are ignored, and some predictions are "invalid" (a head with one logit more, a renderer that saw nothing): 255.
    """
    generator = torch.Generator().manual_seed(seed)
    predicted = torch.randint(0, CLASSES, (images, 6, 9), generator=generator).to(torch.uint8)
    truth = torch.randint(0, CLASSES - 1, (images, 6, 9), generator=generator).to(torch.uint8)
    truth = torch.where(torch.rand(images, 6, 9, generator=generator) < 0.6, predicted.clamp(max=3), truth)
    truth[torch.rand(images, 6, 9, generator=generator) < 0.2] = IGNORE
    predicted[torch.rand(images, 6, 9, generator=generator) < 0.1] = IGNORE
    truth[1] = torch.where(truth[1] == IGNORE, truth[1], truth[1] % 2)
    truth[3] = IGNORE
    return predicted, truth


def scores_by_a_loop(pixels: list[tuple[int, int]]) -> tuple[float, float, float]:
    """mIoU, class accuracy and accuracy of (predicted, true) pixels, step by step as S-Ray and GSNeRF reckon an image.

    1. Pixels without truth are dropped. 2. Of the rest, those predicted as invalid enter no count. 3. Accuracy is the
    trace over the sum. 4. Class accuracy is the mean over the true classes of the share of their pixels that was hit.
    5. IoU is hits over row plus column minus hits; its mean is over the true classes, so a class that is only predicted
    adds no term. 6. Without a valid pixel all three are 0.
    """
    counts: dict[tuple[int, int], int] = {}
    for predicted, true in pixels:
        if true == IGNORE or predicted == IGNORE:
            continue
        counts[true, predicted] = counts.get((true, predicted), 0) + 1
    everything = sum(counts.values())
    if everything == 0:
        return 0.0, 0.0, 0.0
    ious, recalls = [], []
    for label in range(CLASSES):
        row = sum(n for (true, _), n in counts.items() if true == label)
        column = sum(n for (_, predicted), n in counts.items() if predicted == label)
        if row == 0:
            continue
        hits = counts.get((label, label), 0)
        ious.append(hits / (row + column - hits))
        recalls.append(hits / row)
    trace = sum(counts.get((label, label), 0) for label in range(CLASSES))
    return sum(ious) / len(ious), sum(recalls) / len(recalls), trace / everything


def pixels(predicted: torch.Tensor, truth: torch.Tensor) -> list[tuple[int, int]]:
    return list(zip(predicted.flatten().tolist(), truth.flatten().tolist(), strict=True))


@pytest.mark.parametrize("seed", range(3))
def test_scores_of_the_whole_set_equal_a_loop_over_its_pixels(seed: int):
    predicted, truth = label_maps(seed)
    confusion = confusion_matrix(predicted, truth, CLASSES)
    assert [float(score(confusion)) for score in (miou, class_accuracy, accuracy)] == pytest.approx(
        scores_by_a_loop(pixels(predicted, truth)), rel=1e-12
    )


def confusion_matrices(predicted: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """One confusion matrix per image."""
    return torch.stack([confusion_matrix(*pair, CLASSES) for pair in zip(predicted, truth, strict=True)])


@pytest.mark.parametrize("seed", range(3))
def test_scores_per_image_equal_a_loop_per_image_and_an_image_without_truth_counts_as_zero(seed: int):
    predicted, truth = label_maps(seed)
    confusions = confusion_matrices(predicted, truth)
    single = [scores_by_a_loop(pixels(*pair)) for pair in zip(predicted, truth, strict=True)]
    assert single[3] == (0, 0, 0)
    expected = [sum(one) / len(single) for one in zip(*single, strict=True)]
    found = [float(score(confusions).mean()) for score in (miou, class_accuracy, accuracy)]
    assert found == pytest.approx(expected, rel=1e-12)
    of_the_set = scores_by_a_loop(pixels(predicted, truth))
    assert all(abs(a - b) > 1e-3 for a, b in zip(found, of_the_set, strict=True))  # the two kinds are not one


def test_the_confusion_matrix_is_that_of_torchmetrics():
    predicted, truth = label_maps(5)
    counted = (truth != IGNORE) & (predicted != IGNORE)
    expected = multiclass_confusion_matrix(predicted[counted].long(), truth[counted].long(), CLASSES)
    assert torch.equal(confusion_matrix(predicted, truth, CLASSES), expected)


def test_matrices_of_images_add_up_to_that_of_the_set():
    predicted, truth = label_maps(7)
    assert torch.equal(confusion_matrices(predicted, truth).sum(0), confusion_matrix(predicted, truth, CLASSES))


def test_rows_are_the_truth():
    truth = torch.tensor([[0, 0, 0], [1, 1, IGNORE]], dtype=torch.uint8)
    predicted = torch.tensor([[0, 1, 2], [1, 1, 0]], dtype=torch.uint8)
    assert confusion_matrix(predicted, truth, 3).tolist() == [[1, 1, 1], [0, 2, 0], [0, 0, 0]]


def test_a_class_that_is_only_predicted_adds_no_term_but_its_pixels_are_misses():
    truth = torch.zeros(2, 3, dtype=torch.uint8)
    predicted = torch.tensor([[0, 0, 0], [0, 2, 2]], dtype=torch.uint8)
    confusion = confusion_matrix(predicted, truth, 3)
    assert float(miou(confusion)) == pytest.approx(4 / 6)
    assert intersection_over_union(confusion).tolist() == pytest.approx([4 / 6, 0, 0])


def test_pixels_without_a_prediction_are_neither_hit_nor_miss_and_truth_alone_says_which_classes_are_present():
    truth = torch.tensor([[0, 0, 0], [1, 1, 2]], dtype=torch.uint8)
    predicted = torch.tensor([[0, IGNORE, 0], [1, 0, IGNORE]], dtype=torch.uint8)
    confusion = confusion_matrix(predicted, truth, 3)
    assert confusion.tolist() == [[2, 0, 0], [1, 1, 0], [0, 0, 0]]
    assert float(miou(confusion)) == pytest.approx((2 / 3 + 1 / 2) / 2)
    # Class 2 is there, and none of its pixels was predicted: it counts as 0.
    present = present_classes(truth, 3)
    assert float(miou(confusion, present)) == pytest.approx((2 / 3 + 1 / 2 + 0) / 3)
    assert float(class_accuracy(confusion, present)) == pytest.approx((1 + 1 / 2 + 0) / 3)


def test_the_truth_itself_scores_exactly_one():
    _, truth = label_maps(8, images=4)
    confusion = confusion_matrix(truth, truth, CLASSES)
    assert (float(miou(confusion)), float(class_accuracy(confusion)), float(accuracy(confusion))) == (1, 1, 1)


def test_a_label_outside_the_table_is_refused():
    truth = torch.zeros(2, 3, dtype=torch.uint8)
    with pytest.raises(ValueError, match=r"predicted labels contain 3; expected 0\.\.2"):
        confusion_matrix(truth + 3, truth, 3)
    with pytest.raises(ValueError, match=r"predicted labels are \(2, 3\) but the true ones \(3, 2\)"):
        confusion_matrix(truth, truth.mT, 3)


def test_psnr_of_a_constant_error_worked_out_by_hand_and_images_are_clamped():
    truth = torch.full((2, 3, 3, 4), 0.5)
    images = torch.stack([truth[0] + 0.1, truth[1] * 0 + 1.7])
    assert psnr(images, truth).tolist() == pytest.approx([20.0, -20 * math.log10(0.5)], abs=1e-4)
    assert psnr(truth, truth).tolist() == [math.inf, math.inf]


def test_hidden_pixels_do_not_count_in_psnr() -> None:
    """An error of 0.1 at the visible pixels is 20 dB, whatever there is at the hidden ones."""
    truth = torch.full((3, 4, 5), 0.5)
    hidden = torch.zeros(4, 5, dtype=torch.bool)
    hidden[1:3] = True
    assert psnr(truth + torch.where(hidden, -0.4, 0.1), truth, hidden).item() == pytest.approx(20, abs=1e-4)
