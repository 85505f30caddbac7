"""Frames of three files each: `frame-000000.color.png`, `.depth.png`, `.pose.txt`. 7-Scenes, 3DMatch, 12-Scenes, BundleFusion, 3RScan.

Poses are camera to world with OpenCV axes [m], depth is 16-bit PNG or PGM in millimetres, 0 or 65535 where unknown. Frames are in the order of
their numbers. Intrinsics come from `camera-intrinsics.txt` (3DMatch), `info.txt` or `_info.txt`, in the folder or above it, with the
centre of the first pixel at (0, 0), so half a pixel is added. If an info.txt has a separate depth camera, each colour pixel gets the depth
that its ray hits.

7-Scenes has no such file. Its page gives the depth camera of KinectFusion, 585 px and (320, 240), the middle of 640x480, to which nothing is
added. Its colour camera was never calibrated. As in papers on localisation, colour is assumed to have 525 px and the same centre and pose,
and depth is transferred from 585 px along the rays. The 2.5 cm between the two cameras of a Kinect are ignored, so depth is off by about 6 px
at 2 m. https://www.microsoft.com/en-us/research/project/rgb-d-dataset-7-scenes/
"""

from __future__ import annotations

from pathlib import Path

from semgs.data.cameras.lens import Lens
from semgs.data.layouts.parts.calibrations import Calibration, calibration_from_details, read_calibration
from semgs.data.layouts.parts.trajectories import read_pose
from semgs.data.layouts.parts.usable_frames import PICTURES, Shot, ShotList, first_file, numbered_files, sequence_name
from semgs.data.maps import MILLIMETRE, DepthMap, DepthThroughLens, MapSource
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.files.errors import InputError

LAYOUT = "frame files"
DETAILS = ("intrinsics", "depth_unit")

START = "frame-"
COLOUR, DEPTH, POSE = tuple(f".color{ending}" for ending in PICTURES), (".depth.png", ".depth.pgm"), (".pose.txt",)
OF_DEPTH_TOO = ("info.txt", "_info.txt")
"""Files that also have the unit of depth, and perhaps the depth camera: given intrinsics are those of the images alone."""
CALIBRATIONS = ("camera-intrinsics.txt", *OF_DEPTH_TOO)

KINECT_SIZE = (480, 640)
KINECT_CENTRE = (320.0, 240.0)
KINECT_COLOUR = Calibration((525.0, 525.0), KINECT_CENTRE, KINECT_SIZE, of_a_sensor=True)
KINECT_DEPTH = Lens(KINECT_SIZE, (585.0, 585.0), KINECT_CENTRE)


def recognises(path: Path) -> bool:
    """Whether a path is a folder with such frames."""
    if not path.is_dir():
        return False
    return any(one.name.startswith(START) and one.name.endswith(POSE[0]) for one in path.iterdir())


def open_frame_files(path: Path, details: SceneDetails) -> Scene:
    """The scene of a folder of frames.

    Args:
        path: the folder.
        details: may give intrinsics and the depth unit.

    Raises:
        InputError: a pose is damaged, the intrinsics are unknown, or fewer than two frames have an image and a pose.
    """
    colours, depths, poses = (numbered_files(path, START, endings) for endings in (COLOUR, DEPTH, POSE))
    if not colours:
        raise InputError(path, f"images {START}000000{COLOUR[0]}", "none", "frame files")
    calibration_file = first_file((path, path.absolute().parent), CALIBRATIONS)
    given = calibration_from_details(details)
    read = calibration_file is not None and (given is None or calibration_file.name in OF_DEPTH_TOO)
    stated = read_calibration(calibration_file) if calibration_file is not None and read else None
    calibration = given or stated
    notes, depth_lens = [], stated.depth_lens if stated else None
    if calibration_file is None:
        depth_lens = KINECT_DEPTH
        notes.append(
            "7-Scenes' cameras were not calibrated: depth is assumed to have 585 px, "
            + ("colour the given intrinsics" if calibration else "colour 525 px")
            + ", and the 2.5 cm between the two cameras are ignored."
        )
    unit = details.depth_unit or (stated and stated.depth_unit) or MILLIMETRE
    return ShotList(
        path=path,
        layout=LAYOUT,
        shots=[
            Shot(
                colour.name,
                colour,
                read_pose(poses[number]) if number in poses else None,
                _depth(depths.get(number), unit, depth_lens),
            )
            for number, colour in colours.items()
        ],
        lens=(calibration or KINECT_COLOUR).lens,
        name=sequence_name(path),
        unit="metric",
        notes=notes,
    ).scene()


def _depth(path: Path | None, unit: float, lens: Lens | None) -> MapSource | None:
    """The source of a frame's depth; `lens` is the depth camera, if there is a separate one."""
    if path is None:
        return None
    return DepthThroughLens(DepthMap(path, unit), lens) if lens else DepthMap(path, unit)
