"""Replica as rendered by Semantic-NeRF: `rgb/rgb_0.png`, `depth/depth_0.png`, `semantic_class/semantic_class_0.png`, `traj_w_c.txt`.

Line k of `traj_w_c.txt` is the pose of the images with number k: a row-major 4x4 matrix, camera to world, OpenCV axes [m]. Depth is 16-bit
PNG in millimetres. Class maps contain Replica's ids (0: none), which are mapped to ScanNet's 20 classes by `NYU40`. If there is an
`info_semantic.json` near, its names are used.

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
from semgs.data.layouts.parts.trajectories import read_trajectory
from semgs.data.layouts.parts.usable_frames import (
    Shot,
    ShotList,
    first_file,
    note_lacking,
    numbered_files,
    sequence_name,
)
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

NYU40 = {
    "backpack": 40, "base-cabinet": 3, "basket": 40, "bathtub": 36, "beam": 38, "beanbag": 39, "bed": 4, "bench": 39,
    "bike": 40, "bin": 40, "blanket": 40, "blinds": 13, "book": 23, "bottle": 40, "box": 29, "bowl": 40, "camera": 40,
    "cabinet": 3, "candle": 40, "chair": 5, "chopping-board": 40, "clock": 40, "cloth": 21, "clothing": 21, "coaster": 0,
    "comforter": 0, "computer-keyboard": 40, "cup": 40, "cushion": 18, "curtain": 16, "ceiling": 22, "cooktop": 38,
    "countertop": 12, "desk": 14, "desk-organizer": 40, "desktop-computer": 40, "door": 8, "exercise-ball": 40,
    "faucet": 40, "floor": 2, "handbag": 40, "hair-dryer": 40, "handrail": 38, "indoor-plant": 40, "knife-block": 40,
    "kitchen-utensil": 0, "lamp": 35, "laptop": 40, "major-appliance": 0, "mat": 20, "microwave": 40, "monitor": 40,
    "mouse": 40, "nightstand": 32, "pan": 40, "panel": 0, "paper-towel": 40, "phone": 40, "picture": 11, "pillar": 38,
    "pillow": 18, "pipe": 40, "plant-stand": 39, "plate": 40, "pot": 40, "rack": 39, "refrigerator": 24,
    "remote-control": 40, "scarf": 0, "sculpture": 40, "shelf": 15, "shoe": 40, "shower-stall": 38, "sink": 34,
    "small-appliance": 0, "sofa": 6, "stair": 38, "stool": 40, "switch": 40, "table": 7, "table-runner": 0, "tablet": 40,
    "tissue-paper": 40, "toilet": 33, "toothbrush": 40, "towel": 27, "tv-screen": 25, "tv-stand": 39, "umbrella": 40,
    "utensil-holder": 0, "vase": 40, "vent": 40, "wall": 1, "wall-cabinet": 3, "wall-plug": 40, "wardrobe": 39, "window": 9,
    "rug": 40, "logo": 40, "bag": 37, "set-of-clothing": 21,
}  # fmt: skip
"""The NYU40 class of each of Replica's 101 names, in the order of its ids from 1; 0 for none.

Each name was looked up in ScanNet's own list of raw categories (`scannetv2-labels.combined.tsv`), which gives its NYU40 class; 0 means that
ScanNet has no such category. As in ScanNet, all but the 20 classes are ignored, so rugs, blinds, cushions, shelves, stools and night stands
have no class here. Names that ScanNet spells differently are looked up in its spelling: `base-cabinet` as kitchen cabinet, `wall-cabinet` as
cabinet, `countertop` as kitchen counter, `beanbag` as beanbag chair, `plant-stand` as flower stand, `bike` as bicycle, `indoor-plant` as
plant, `wall-plug` as power outlet, and so on.
"""

IDS = {number: name for number, name in enumerate(NYU40, start=1)}
"""The name of each id."""


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
