"""Replica as Semantic-NeRF rendered it: `rgb/rgb_0.png`, `depth/depth_0.png`, `semantic_class/semantic_class_0.png`, `traj_w_c.txt`.

Line k of `traj_w_c.txt` is the pose of the pictures with number k: a row-major 4x4 matrix, camera to world, OpenCV axes [m]. Depth is 16-bit
PNG in millimetres. A class map holds Replica's ids (0: none), which become ScanNet's 20 classes by `replica_classes`; where an
`info_semantic.json` lies near, its names count.

The renderer had 90 degrees across the picture, so fx = fy = W / 2, and its principal point at ((W - 1) / 2, (H - 1) / 2) counts from the
centre of the first pixel: (W / 2, H / 2) here, 320 and 240 for 640x480. S-Ray's and GSNeRF's code has 229.5 for cy, 10 rows above; to
compare with what they print, ask for intrinsics 320 320 320 230. https://github.com/Harry-Zhi/semantic_nerf
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from semgs.data.asked import Asked
from semgs.data.classes import IGNORE, SCANNET20, ClassTable
from semgs.data.frames import Frame
from semgs.data.layouts.calibrations import asked_calibration
from semgs.data.layouts.fields import parsed
from semgs.data.layouts.recordings import Shot, numbered, recorded, sequence_name
from semgs.data.layouts.replica_classes import IDS, labels_by_id
from semgs.data.layouts.trajectories import read_trajectory
from semgs.data.lens import Lens
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.pictures import decode_map

LAYOUT = "Replica"
LOOKED_FOR = "traj_w_c.txt with rgb/rgb_0.png (Replica, Semantic-NeRF's)"

POSES, RGB, DEPTH, CLASSES = "traj_w_c.txt", "rgb", "depth", "semantic_class"
INFO = "info_semantic.json"
MILLIMETRE = 0.001


def recognises(path: Path) -> bool:
    """Whether a path is the folder of one of Replica's sequences."""
    return (path / POSES).is_file() and bool(numbered(path / RGB, "rgb_", (".png",)))


def open_replica(path: Path, asked: Asked) -> Scene:
    """The scene of a sequence, frames in the order of their numbers.

    Args:
        path: its folder (`office_0/Sequence_1`).
        asked: may give intrinsics.

    Raises:
        InputError: the poses are damaged, or fewer than two frames have a picture and a pose.
    """
    asked.only(path, LAYOUT, "intrinsics")
    colours, depths, labels = (
        numbered(path / folder, f"{folder}_", (".png",)) for folder in (RGB, DEPTH, CLASSES)
    )
    trajectory = read_trajectory(path / POSES)
    if trajectory.times is not None:
        raise InputError(path / POSES, "a 4x4 matrix a line", "lines of 8 numbers", trajectory.places[0])
    names, told_by = _names(path)
    given = asked_calibration(asked)
    shots = [
        Shot(
            f"{RGB}/rgb_{number}.png",
            colours.get(number, path / RGB / f"rgb_{number}.png"),
            trajectory.poses[number] if number < len(trajectory) else None,
            (path / POSES, trajectory.places[number] if number < len(trajectory) else ""),
            depths.get(number),
            labels.get(number),
        )
        for number in sorted({*colours, *range(len(trajectory))})
    ]
    unknown = sorted(set(names.values()) - set(IDS.values()))
    return recorded(
        path,
        LAYOUT,
        shots,
        given.lens if given else _lens,
        name=sequence_name(path),
        unit="metric",
        frame=partial(ClassIdFrame, depth_unit=MILLIMETRE, labels_by_id=labels_by_id(names)),
        classes=SCANNET20,
        notes=[f"{len(unknown)} classes of {told_by} are none of Replica's and ignored, the first is {unknown[0]}."]
        if unknown
        else [],
    )


@dataclass(frozen=True, eq=False)
class ClassIdFrame(Frame):
    """A frame whose class map holds ids of its data set.

    Attributes:
        labels_by_id: the label of each id; larger ids have none.
    """

    labels_by_id: np.ndarray = field(default_factory=lambda: np.zeros(0, np.uint8), repr=False)

    def read_labels(self, classes: ClassTable) -> UInt8[np.ndarray, "h w"] | None:
        """The class of each pixel, 255 = none; as `Frame.read_labels`.

        Raises:
            InputError: the map is absent, damaged, or of another aspect than the picture.
        """
        if self.label_path is None:
            return None
        try:
            data = self.label_path.read_bytes()
        except OSError as error:
            raise InputError(self.label_path, "a class map", error.strerror or str(error)) from error
        lookup = np.full(1 << 16, IGNORE, np.uint8)
        lookup[: len(self.labels_by_id)] = self.labels_by_id
        return self.fitted(self.label_path, lookup[decode_map(data, self.label_path)])


def _lens(picture: Path, size: tuple[int, int]) -> Lens:
    """The renderer's camera for pictures of a size (height, width)."""
    height, width = size
    return Lens(size, (width / 2, width / 2), (width / 2, height / 2))


def _names(path: Path) -> tuple[dict[int, str], Path | None]:
    """The names of Replica's ids, and the file that says so, where one lies near.

    Raises:
        InputError: the file is damaged.
    """
    above = path.absolute().parent
    places = (path, above, above / "habitat", above.parent / "semantic_info" / above.name)
    file = next((place / INFO for place in places if (place / INFO).is_file()), None)
    if file is None:
        return IDS, None
    names = {}
    for one in parsed(file).objects("classes"):
        number, name = one.number("id"), one.text("name")
        if number is None or name is None or not number.is_integer() or not 0 <= number < 1 << 16:
            raise one.refused("id", "an id from 0 to 65535 with a name", f"{one.values!r:.60}")
        names[int(number)] = name
    return names, file
