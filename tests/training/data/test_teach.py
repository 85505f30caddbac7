"""The script that writes a teacher's maps: through a table to other classes, and mixed with a network of SemGS."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from posed import posed_views
from teach import Mixture, predicted

from semgs.model.weights.initial_weights import initial_network
from semgs.training.data.augmentation import flip

TABLE = np.eye(3, 20, k=4, dtype=np.float32)
"""Three classes that are our classes 4, 5 and 6."""


class Brightness:
    """Says its class 0 as likely as a pixel is red, and class 2 otherwise."""

    def probabilities(self, image: np.ndarray) -> np.ndarray:
        red = image[..., :1].astype(np.float32) / 255
        return np.concatenate((red, np.zeros_like(red), 1 - red), -1)


def test_without_a_table_the_maps_are_the_networks_own():
    views = posed_views(1, (32, 48), seed=2)
    maps = predicted(views, Brightness(), (16, 24), Mixture())
    red = torch.nn.functional.avg_pool2d(views.images[:, 0], 2)[0].numpy()
    assert maps.shape == (1, 16, 24, 3)
    assert maps[0, ..., 0] == pytest.approx(red, abs=4e-3)


def test_a_table_names_the_classes_anew():
    views = posed_views(1, (32, 48), seed=2)
    own, ours = (predicted(views, Brightness(), (16, 24), Mixture(table)) for table in (None, TABLE))
    assert np.array_equal(ours[..., 4:7], own)
    assert not ours[..., :4].any()
    assert not ours[..., 7:].any()


def test_a_mixture_of_mirrored_images_is_mirrored_and_its_ends_are_either_network():
    views, network = posed_views(1, (32, 48), seed=2), initial_network("small", "random").eval()
    mixture = Mixture(TABLE, network, 0.5)
    maps = mixture.predict(views, Brightness(), (16, 24))
    assert torch.allclose(maps.sum(1), torch.ones(1, 16, 24), atol=1e-5)
    assert torch.allclose(mixture.predict(flip(views), Brightness(), (16, 24)), maps.flip(-1), atol=1e-5)
    alone = Mixture(TABLE, network, 1.0).predict(views, Brightness(), (16, 24))
    assert torch.allclose(alone, Mixture(TABLE).predict(views, Brightness(), (16, 24)), atol=4e-3)
    ours = Mixture(TABLE, network, 0.0).predict(views, Brightness(), (16, 24))
    assert torch.allclose((alone + ours) / 2, maps, atol=1e-6)
