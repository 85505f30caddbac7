"""What a validation says and shows."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.rendering.rendering import Rendering
from semgs.training.supervision.supervision import Rendered, render_targets
from semgs.training.supervision.validation import strip


def test_scores_are_those_of_all_target_pixels_together(network, batch):
    model, batches = network(), [batch(step, scenes=1) for step in range(3)]
    result = Rendered().validate(model, batches)
    predicted, truth, decibels = [], [], []
    with torch.no_grad():
        for one in batches:
            rendering, target = render_targets(model(one.context), one)
            predicted.append(rendering.semantics.argmax(2).flatten())
            truth.append(target.labels.flatten().long())
            errors = (rendering.images.clamp(0, 1) - target.images).square().flatten(2).mean(2).flatten()
            decibels += [-10 * float(torch.log10(error)) for error in errors]
    predicted, truth = torch.cat(predicted), torch.cat(truth)
    ious = [
        float(((predicted == k) & (truth == k)).sum() / (((predicted == k) | (truth == k)) & (truth != IGNORE)).sum())
        for k in range(20)
        if (truth == k).any()
    ]
    assert result.numbers["psnr"] == pytest.approx(np.mean(decibels), rel=1e-5)
    assert result.numbers["miou"] == pytest.approx(np.mean(ious), rel=1e-5)
    assert result.numbers["accuracy"] == pytest.approx(
        float((predicted == truth)[truth != IGNORE].float().mean()), rel=1e-6
    )
    assert result.pictures.shape == (3 * 16, 6 * 24, 3)


def test_without_scenes_there_is_nothing_to_say(network):
    result = Rendered().validate(network(), [])
    assert np.isnan(result.numbers["psnr"])
    assert (result.numbers["miou"], result.numbers["accuracy"], result.pictures) == (None, None, None)


def test_the_strip_shows_image_classes_and_depth_each_beside_its_truth(batch):
    target = batch(0).target
    height, width = target.size
    labels = torch.full((2, 2, height, width), 3)
    alphas = torch.ones(2, 2, height, width)
    alphas[..., :5] = 0.4
    rendering = Rendering(
        images=target.images,
        semantics=torch.nn.functional.one_hot(labels, 20).movedim(-1, -3).float(),
        depths=target.depths,
        alphas=alphas,
    )
    image, true_image, classes, true_classes, depth, true_depth = np.split(strip(rendering, target), 6, axis=1)
    assert np.array_equal(image, true_image)
    assert np.array_equal(depth, true_depth)
    assert (classes[:, 5:] == SCANNET20.colours[3]).all()
    assert not (classes[:, :5] == SCANNET20.colours[3]).all(-1).any()
    # The first row of the batch's labels is ignored; elsewhere each pixel has the colour of its label.
    assert (true_classes[0] == 0).all()
    assert tuple(true_classes[7, 9]) == SCANNET20.colours[int(target.labels[0, 0, 7, 9])]
    colour_only = Rendering(rendering.images, None, rendering.depths, rendering.alphas)
    assert strip(colour_only, target).shape == (height, 5 * width, 3)
