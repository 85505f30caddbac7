"""A cache of what the class branch finds in single views, for scenes whose views are encoded several times, each time with others."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable, Sequence

from jaxtyping import Float
from torch import Tensor

from semgs.model.classes.refinement import ViewFeatures

MOST = 16
"""Views in a cache; at 240x320, one takes 5 MB."""


class ViewCache:
    """The features of the latest views, by their images. It is for one network, with one precision and number of looks.

    Args:
        most: number of views.
    """

    def __init__(self, most: int = MOST) -> None:
        self._most = most
        self._known: OrderedDict[bytes, ViewFeatures] = OrderedDict()

    def features(
        self, images: Float[Tensor, "n 3 h w"], compute: Callable[[Sequence[int]], ViewFeatures]
    ) -> ViewFeatures:
        """The features of views, of which only those of new images are computed.

        Args:
            images: of the views.
            compute: from positions among the images to the features of these views.
        """
        keys = [digest(image) for image in images]
        new = [position for position, key in enumerate(keys) if key not in self._known]
        if new:
            computed = compute(new)
            for place, position in enumerate(new):
                self._known[keys[position]] = computed[place : place + 1]
        for key in keys:
            self._known.move_to_end(key)
        found = computed if len(new) == len(keys) else ViewFeatures.joined([self._known[key] for key in keys])
        while len(self._known) > self._most:
            self._known.popitem(last=False)
        return found


def digest(image: Float[Tensor, "3 h w"]) -> bytes:
    """A hash of an image and its size."""
    pixels = image.detach().cpu().numpy().tobytes()
    return hashlib.blake2b(pixels, person=b"%dx%d" % tuple(image.shape[-2:])).digest()
