"""Replica as rendered by Semantic-NeRF: `rgb/rgb_0.png`, `depth/depth_0.png`, `semantic_class/semantic_class_0.png`, `traj_w_c.txt`.

Line k of `traj_w_c.txt` is the pose of the images with number k: a row-major 4x4 matrix, camera to world, OpenCV axes [m]. Depth is 16-bit
PNG in millimetres. Class maps contain Replica's ids (0: none), which are mapped to ScanNet's 20 classes by
`semgs.data.layouts.replica.replica_classes`. If there is an `info_semantic.json` near, its names are used.

The renderer's horizontal field of view was 90 degrees, so fx = fy = W / 2. Its principal point, ((W - 1) / 2, (H - 1) / 2) from the centre of
the first pixel, is (W / 2, H / 2) here: 320 and 240 for 640x480. The code of S-Ray and GSNeRF has 229.5 for cy, 10 rows above:
the reading "row-229.5" of `semgs.data.paper_variants`. https://github.com/Harry-Zhi/semantic_nerf
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from functools import partial
from pathlib import Path

from semgs.data.cameras.lens import HALF, Lens
from semgs.data.layouts.parts.calibrations import calibration_from_details
from semgs.data.layouts.parts.fields import read_fields
from semgs.data.layouts.parts.sentences import note_lacking
from semgs.data.layouts.parts.trajectories import read_trajectory
from semgs.data.layouts.parts.usable_frames import Shot, ShotList, first_file, numbered_files, sequence_name
from semgs.data.layouts.replica.replica_classes import IDS, NYU40
from semgs.data.layouts.scannet.scannet_labels import labels_of_ids
from semgs.data.maps import DepthMap, IdMap
from semgs.data.paper_variants import READINGS, ROW_229
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError, input_error
from semgs.files.stored import Stored

LAYOUT = "Replica"
APPLICABLE = (ROW_229,)
DETAILS = ("intrinsics",)

POSES, RGB, DEPTH, CLASSES = "traj_w_c.txt", "rgb", "depth", "semantic_class"
INFO = "info_semantic.json"
PEERS_ROW = (229.5 + HALF) / 480
"""The principal point in S-Ray's and GSNeRF's code, relative to the height."""


def recognises(path: Path) -> bool:
    """Whether a path is the folder of one of Replica's sequences."""
    return (path / POSES).is_file() and bool(numbered_files(path / RGB, "rgb_", (".png",)))


def open_replica(path: Path, as_peers: Collection[str], details: SceneDetails) -> Scene:
    """The scene of a sequence, frames in the order of their numbers.

    Args:
        path: its folder (`office_0/Sequence_1`).
        as_peers: readings of `APPLICABLE`.
        details: may give intrinsics.

    Raises:
        InputError: the poses are damaged, or fewer than two frames have an image and a pose.
    """
    colours, depths, labels = (
        numbered_files(path / folder, f"{folder}_", (".png",)) for folder in (RGB, DEPTH, CLASSES)
    )
    trajectory = read_trajectory(path / POSES)
    if trajectory.times is not None:
        raise InputError(path / POSES, "a 4x4 matrix per line", "lines of 8 numbers", trajectory.places[0])
    unread = None
    try:
        names, names_file = _names(path)
    except InputError as error:
        names, names_file, unread = {}, None, error
    given = calibration_from_details(details)
    by_id = labels_of_ids({number: NYU40.get(name, 0) for number, name in names.items()})
    shots = [
        Shot(
            f"{RGB}/rgb_{number}.png",
            colours.get(number, path / RGB / f"rgb_{number}.png"),
            trajectory.at(number),
            DepthMap(depths[number]) if number in depths else None,
            IdMap(labels[number], by_id) if number in labels else None,
        )
        for number in sorted({*colours, *range(len(trajectory))})
    ]
    unknown = sorted(set(names.values()) - NYU40.keys())
    scene = ShotList(
        path=path,
        layout=LAYOUT,
        shots=shots,
        lens=given.lens if given else partial(_lens, row=PEERS_ROW if ROW_229 in as_peers else 0.5),
        name=sequence_name(path),
        unit="metric",
        classes=SCANNET20,
        notes=[
            *note_lacking(unknown, len(names), f"classes of {names_file} are not Replica's and are ignored"),
            *(f"Read as in other papers' code: {READINGS[one]}." for one in APPLICABLE if one in as_peers),
        ],
    ).scene()
    return scene if unread is None else replace(scene, classes=None, unread_labels=unread)


def _lens(picture: Stored, size: tuple[int, int], row: float) -> Lens:
    """The renderer's camera for images of a size (height, width), with the principal point at `row` relative to the height."""
    height, width = size
    with input_error(picture, "an image that the renderer of Replica could have made"):
        return Lens(size, (width / 2, width / 2), (width / 2, row * height))


def _names(path: Path) -> tuple[dict[int, str], Path | None]:
    """The names of Replica's ids, and the file near the sequence that they are from, if there is one."""
    above = path.absolute().parent
    places = (path, above, above / "habitat", above.parent / "semantic_info" / above.name)
    file = first_file(places, (INFO,))
    if file is None:
        return IDS, None
    names = {}
    for one in read_fields(file).objects("classes"):
        number, name = one.number("id"), one.text("name")
        if number is None or name is None or not number.is_integer() or not 0 <= number < 1 << 16:
            raise one.refused("id", "an id from 0 to 65535 with a name", f"{one.values!r:.60}")
        names[int(number)] = name
    return names, file
