"""Teacher: another network's class probabilities for the training images, computed once. An extra head learns them.

    FOLDER/SOURCE/SCENE.npy     probabilities of its k classes [frame rows columns k], float16; all 0 for a frame without any

SCENE is the name of the scene's folder (or of its archive, without the ending), SOURCE the name of the folder around it. Frames are
numbered as in `semgs.data.scene.Scene`. The maps cover the full image, at any resolution. `scripts/teach.py` writes them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import avg_pool2d, grid_sample, log_softmax

from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.files.paths import not_hidden, typed_path

STRIDE = 8
"""Pixels of the image along each side of a texel of the teacher's maps."""


@dataclass(frozen=True)
class Teacher:
    """A folder of another network's class probabilities.

    Attributes:
        folder: where it is.
        classes: how many classes the network has.
    """

    folder: Path
    classes: int

    @staticmethod
    def open(name: str | Path) -> Teacher:
        """The teacher of a folder, whose name the user has typed.

        Raises:
            InputError: it has no maps.
        """
        folder = typed_path(name)
        first = next(iter(not_hidden(folder.glob("*/*.npy"))), None)
        if first is None:
            raise InputError(
                folder, "class probabilities of training pictures, SOURCE/SCENE.npy", "none",
                advice="scripts/teach.py writes them",
            )  # fmt: skip
        return Teacher(folder, _load_maps(first).shape[-1])

    def path(self, scene: Scene) -> Path:
        """Where the maps of a scene are."""
        own = [path for path in (scene.path, *scene.path.parents) if path.name.removesuffix(".zip") == scene.name]
        return self.folder / (own or [scene.path])[0].parent.name / f"{scene.name}.npy"

    def maps(self, scene: Scene, frame: int) -> Float[Tensor, "1 k rows columns"] | None:
        """The probabilities for a frame; None if there are none for the scene.

        Raises:
            InputError: the numbers of frames or classes differ.
        """
        path = self.path(scene)
        if not path.exists():
            return None
        maps = _load_maps(path)
        if (len(maps), maps.shape[-1]) != (len(scene), self.classes):
            raise InputError(
                path, f"maps of {len(scene)} frames and {self.classes} classes", f"{len(maps)} and {maps.shape[-1]}"
            )
        return torch.from_numpy(maps[frame].astype(np.float32)).permute(2, 0, 1)[None]

    def augmented_maps(self, maps: Tensor | None, seen: Views) -> Float[Tensor, "v k h8 w8"]:
        """The probabilities for augmented views, at 1/8 of their size.

        Args:
            maps: of the views before augmentation; None gives 0 everywhere.
            seen: the `coordinates` of those views, augmented in the same way.
        """
        at = avg_pool2d(seen.images, STRIDE)
        if maps is None:
            return torch.zeros(len(at), self.classes, *at.shape[-2:])
        grid = 2 * at[:, :2].permute(0, 2, 3, 1) - 1
        return grid_sample(maps, grid, padding_mode="border", align_corners=False)


def coordinates(views: Views) -> Views:
    """The views with each pixel's position as its colour: how far right and how far down it is, 0..1; without labels and depths."""
    height, width = views.size
    x, y = ((torch.arange(side) + 0.5) / side for side in (width, height))
    place = torch.stack((x.expand(height, width), y[:, None].expand(height, width), torch.zeros(height, width)))
    return views.changed(images=place.expand(views.images.shape).contiguous(), labels=None, depths=None)


def divergence(logits: Float[Tensor, "n k h4 w4"], taught: Float[Tensor, "n k h8 w8"]) -> Float[Tensor, " n"]:
    """KL(teacher || head) of each view, the mean over texels with probabilities; 0 for a view without any [nat].

    Args:
        logits: of the head, at 1/4 of the image; they may be padded below and at the right.
        taught: the teacher's probabilities.
    """
    logits = avg_pool2d(logits.float(), 2)[..., : taught.shape[-2], : taught.shape[-1]]
    total = taught.sum(1, keepdim=True)
    known = (total > 0.5)[:, 0]
    truth = taught / total.clamp(min=1e-6)
    terms = (truth * (truth.clamp(min=1e-6).log() - log_softmax(logits, 1))).sum(1)
    return (terms * known).sum((-2, -1)) / known.sum((-2, -1)).clamp(min=1)


def _load_maps(path: Path) -> np.ndarray:
    """The array of a file; its numbers are only read when they are needed."""
    try:
        maps = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError, EOFError) as error:
        raise InputError(path, "an array of class probabilities", str(error)) from error
    if maps.ndim != 4 or maps.dtype.kind != "f":
        raise InputError(path, "numbers [frame rows columns class]", f"{maps.dtype} {maps.shape}")
    return maps
