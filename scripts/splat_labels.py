"""How well a splat is labelled from its photos: with true class maps, with `small`, and what `semgs reconstruct` says on the same photos.

    semgs rooms ROOMS --scenes 1 --frames 30 --seed 777
    semgs reconstruct ROOMS/scene_00000 --all --views 3 --refine 15 --out OUT
    python scripts/splat_labels.py ROOMS/scene_00000 OUT

The splat is the reconstruction without its classes. The photos that made it say the classes; all others are scored.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.geometry.gaussians import Gaussians
from semgs.model.weights.load import load
from semgs.objectives.metrics import accuracy, confusion_matrix, miou
from semgs.reconstruction.network_classes import NetworkClasses
from semgs.reconstruction.result import GivenSplat
from semgs.reconstruction.splat_labelling import label_splat
from semgs.rendering.render import render
from semgs.rendering.rendering import label_maps
from semgs.scene.scene_file import load_scene
from semgs.segmenters.class_source import ClassSource
from semgs.segmenters.labelling import Labelling


@dataclass(frozen=True)
class TrueMaps:
    """The labels of a scene as a source of classes."""

    scene: Scene
    classes: ClassTable = SCANNET20
    title: str = "true class maps"
    made_by: None = None

    @property
    def known(self) -> Bool[np.ndarray, " class"]:
        """All of the table."""
        return np.ones(len(self.classes), bool)

    def of(self, frame: Frame, size: tuple[int, int]) -> Float[Tensor, "class h w"]:
        """1 for the label of each pixel; 0 for all classes where it has none."""
        labels = self.scene.read([frame.name], size).labels
        assert labels is not None
        ones = torch.nn.functional.one_hot(labels[0].long(), 256)[..., : len(self.classes)]
        return ones.permute(2, 0, 1).float()


def main(path: str, out: str) -> None:
    """Print a row for the reconstruction and for each source."""
    scene, saved = open_scene(Path(path)), load_scene(Path(out))
    used = [scene.index(name) for name in saved.frames]
    others = [position for position in range(len(scene)) if position not in used]
    gaussians = Gaussians(saved.gaussians.means, saved.gaussians.opacities, saved.gaussians.colour)
    sources: list[ClassSource] = [TrueMaps(scene), NetworkClasses(load("small").eval())]
    rows = {"semgs reconstruct": saved.gaussians}
    for source in sources:
        given = GivenSplat("room.ply", "PLY", len(used))
        rows[source.title] = label_splat(scene, gaussians, Labelling(source), given, used, up="z").saved.gaussians
    print(f"{len(used)} photos say the classes of {len(gaussians):,} Gaussians; scored on {len(others)} others")
    print(f"{'':20}mIoU   accuracy")
    views = scene.read(others)
    assert views.labels is not None
    for name, labelled in rows.items():
        predicted = torch.from_numpy(label_maps(render(labelled, views.cameras)))
        matrix = confusion_matrix(predicted, views.labels, len(SCANNET20))
        print(f"{name:20}{miou(matrix):.3f}  {accuracy(matrix):.3f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
