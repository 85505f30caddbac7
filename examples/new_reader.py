"""A reader for a layout of your own, with depth from a second camera, labels by id and masks.

    python examples/new_reader.py SCENE

SCENE has cameras.json {"colour": {"size": [h, w], "focal": [fx, fy], "centre": [cx, cy]}, "depth": {...}}, poses.txt
with a name and a 4x4 camera-to-world matrix per line, and NAME.png in rgb/, depth/ (fifths of a millimetre), ids/
(1 chair, 2 table, 3 wall) and perhaps mask/.
"""

import sys
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.fields import read_fields
from semgs.data.maps import DepthMap, DepthThroughLens, IdMap, MaskMap
from semgs.data.scene import Scene
from semgs.data.tables.classes import IGNORE, SCANNET20

LABELS = np.full(1 << 16, IGNORE, np.uint8)
LABELS[[1, 2, 3]] = [SCANNET20.index(name) for name in ("chair", "table", "wall")]


def open_mine(path: Path) -> Scene:
    """The scene; a line in `semgs.data.scenes.LAYOUTS` makes all commands read it."""
    cameras = read_fields(path / "cameras.json").values
    colour, depth = (Lens(**{key: tuple(two) for key, two in cameras[name].items()}) for name in ("colour", "depth"))
    poses, frames = np.loadtxt(path / "poses.txt", usecols=range(1, 17)).reshape(-1, 4, 4), []
    for name, pose in zip(np.loadtxt(path / "poses.txt", dtype=str, usecols=0), poses, strict=True):
        image, measured, ids, mask = (path / folder / f"{name}.png" for folder in ("rgb", "depth", "ids", "mask"))
        seen = DepthThroughLens(DepthMap(measured, unit=0.0002), depth)
        hidden = MaskMap(mask) if mask.is_file() else None
        frames.append(Frame(str(name), image, colour, pose, seen, IdMap(ids, LABELS), hidden))
    return Scene(path, path.name, "mine", "metric", tuple(frames), classes=SCANNET20)


if __name__ == "__main__":
    print(open_mine(Path(sys.argv[1])).read([0, 1]))
