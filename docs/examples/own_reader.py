"""A worked example: a reader for a data set of one's own, with depth of another camera, labels by id, and masks.

    SCENE/cameras.json    {"colour": {"size": [h, w], "focal": [fx, fy], "centre": [cx, cy]}, "depth": {the same}}
    SCENE/poses.txt       a name and a row-major 4x4 matrix a line, camera to world, OpenCV axes [m]
    SCENE/rgb/NAME.png    images
    SCENE/depth/NAME.png  z-depth of the depth camera, at the place of the colour camera, in fifths of a millimetre
    SCENE/ids/NAME.png    object ids: 1 chair, 2 table, 3 wall; everything else has no label
    SCENE/mask/NAME.png   dark where a face was hidden; most images have none

Try it: python docs/examples/own_reader.py SCENE
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from semgs.data.classes import IGNORE, SCANNET20
from semgs.data.frames import Frame
from semgs.data.layouts.parts.fields import parsed
from semgs.data.layouts.parts.poses import checked_poses
from semgs.data.lens import Lens
from semgs.data.maps import DepthMap, DepthThroughLens, IdMap, MaskMap
from semgs.data.scene import Scene

LABELS = np.full(1 << 16, IGNORE, np.uint8)
LABELS[[1, 2, 3]] = [SCANNET20.index(name) for name in ("chair", "table", "wall")]


def recognises(path: Path) -> bool:
    """Whether a path is such a scene; `semgs.data.scenes.LAYOUTS` takes this and `open_mine`, and all commands read it."""
    return (path / "cameras.json").is_file() and (path / "poses.txt").is_file()


def open_mine(path: Path) -> Scene:
    """The scene: every part is named here, and read when it is needed."""
    cameras = parsed(path / "cameras.json")
    colour, depth = (_lens(cameras.values[name]) for name in ("colour", "depth"))
    lines = [line.split() for line in (path / "poses.txt").read_text().splitlines()]
    names = [line[0] for line in lines]
    poses = checked_poses(path / "poses.txt", [np.reshape(line[1:], (4, 4)) for line in lines], names)
    frames = []
    for name, pose in zip(names, poses, strict=True):
        measured = DepthThroughLens(DepthMap(path / f"depth/{name}.png", unit=0.0002), depth)
        labels, mask = IdMap(path / f"ids/{name}.png", LABELS), path / f"mask/{name}.png"
        hidden = MaskMap(mask) if mask.is_file() else None
        frames.append(Frame(name, path / f"rgb/{name}.png", colour, pose, measured, labels, hidden))
    return Scene(path, path.name, "mine", "metric", tuple(frames), classes=SCANNET20)


def _lens(camera: dict) -> Lens:
    return Lens(tuple(camera["size"]), tuple(camera["focal"]), tuple(camera["centre"]))


if __name__ == "__main__":
    print(open_mine(Path(sys.argv[1])).read([0, 1]))
