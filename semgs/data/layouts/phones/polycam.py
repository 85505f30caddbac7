"""Polycam's raw data: `keyframes/cameras/TIME.json`, `images/TIME.jpg`, `depth/TIME.png`, in a folder or the exported zip archive.

If Polycam has optimised the poses, `corrected_cameras/` and `corrected_images/`, which are undistorted, are read instead.

A camera file has `width`, `height` (newer exports have none in `corrected_cameras/`: then intrinsics are for the image as it is), `fx`, `fy`, `cx`, `cy` [px], `blur_score` (lower is more blurred), and the rows `t_00` to `t_23` of the
pose: camera to world [m], with ARKit's axes, which are OpenGL's (x right, y up, z backward). They become OpenCV's by negating the second and
third column. The principal point counts from the corner of the first pixel, as nerfstudio reads it. Depth is 16-bit PNG in millimetres, smaller
than the image, and belongs to the camera in `cameras/`: if another one is read, each pixel gets the depth that its ray hits. Where
`confidence/TIME.png` is 0 (low), depth is unknown.
https://github.com/PolyCam/polyform, https://docs.nerf.studio/quickstart/custom_dataset.html
"""

from __future__ import annotations

from pathlib import Path
from statistics import median

import numpy as np

from semgs.data.layouts.parts.calibrations import Calibration, calibration_from_details
from semgs.data.layouts.parts.fields import Fields, read_fields
from semgs.data.layouts.parts.trajectories import FoundPose
from semgs.data.layouts.parts.usable_frames import PICTURES, Shot, ShotList, note_lacking
from semgs.data.layouts.phones.capture import find_capture
from semgs.data.maps import DepthMap, DepthThroughLens, MapSource
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_header
from semgs.files.stored import Stored

LAYOUT = "Polycam"
LOOKED_FOR = "keyframes/cameras/ with keyframes/images/ (Polycam's raw data; also in a .zip)"
DETAILS = ("intrinsics",)

KEYFRAMES = "keyframes"
CAMERAS, IMAGES, DEPTH, CONFIDENCE = (f"{KEYFRAMES}/{name}" for name in ("cameras", "images", "depth", "confidence"))
CORRECTED_CAMERAS, CORRECTED_IMAGES = f"{KEYFRAMES}/corrected_cameras", f"{KEYFRAMES}/corrected_images"
JSON = (".json",)
NOT_OPTIMISED = "Polycam did not optimise the poses of this capture: they may drift, and images are slightly distorted."
SHARP = 25.0
"""The least `blur_score`, as in nerfstudio's importer."""


def recognises(path: Path) -> bool:
    """Whether a path is such a capture.

    Raises:
        InputError: it has the ending of a zip archive, but is not one, or is damaged.
    """
    capture = find_capture(path, KEYFRAMES)
    return capture is not None and any(capture.numbered(folder, JSON) for folder in (CAMERAS, CORRECTED_CAMERAS))


def open_polycam(path: Path, details: SceneDetails) -> Scene:
    """The scene of a capture, frames in the order of their times.

    Args:
        path: its folder or archive.
        details: may give intrinsics.

    Raises:
        InputError: a camera is damaged, or fewer than two sharp frames have an image.
    """
    capture = find_capture(path, KEYFRAMES)
    if capture is None:
        raise InputError(path, LOOKED_FOR, "nothing like that")
    raw, corrected = (capture.numbered(folder, JSON) for folder in (CAMERAS, CORRECTED_CAMERAS))
    optimised = bool(corrected and capture.numbered(CORRECTED_IMAGES, PICTURES))
    folder = CORRECTED_IMAGES if optimised else IMAGES
    cameras = {time: read_fields(file) for time, file in (corrected if optimised else raw).items()}
    scores = {time: _sharpness(camera) for time, camera in cameras.items()}
    few = sum(score >= SHARP for score in scores.values()) < 2
    least = median(scores.values()) if few and scores else SHARP
    sharp = {time: camera for time, camera in cameras.items() if scores[time] >= least}
    blurred = [str(time) for time in cameras if time not in sharp]
    images = capture.numbered(folder, PICTURES)
    unposed = [image.name for time, image in images.items() if time not in cameras]
    depths, confidences = (capture.numbered(place, (".png",)) for place in (DEPTH, CONFIDENCE))
    uncorrected = capture.numbered(IMAGES, PICTURES) if optimised else images
    keyframes = {*raw, *uncorrected, *cameras}
    lacking = [str(time) for time in sorted(keyframes - {*cameras, *images})] if optimised else []
    given, calibrations, shots = calibration_from_details(details), dict[Stored, Calibration](), list[Shot]()
    for time, camera in sharp.items():
        image = images.get(time) or path / folder / f"{time}.jpg"
        calibrations[image] = given or _calibration(camera)
        measured = DepthMap(depths[time], confidence=confidences.get(time)) if time in depths else None
        depth = _depth(measured, raw.get(time) if optimised else None, uncorrected.get(time))
        shots.append(Shot(f"{folder}/{image.name}", image, _pose(camera), depth))
    return ShotList(
        path=path,
        layout=LAYOUT,
        shots=shots,
        lens=lambda image, size: calibrations[image].lens(image, size),
        name=capture.name,
        unit="metric",
        notes=[
            *([] if optimised else [NOT_OPTIMISED]),
            *([f"Fewer than two frames have a blur_score of {SHARP:g}: the sharper half is used. Expect a softer result."] if few else []),
            *note_lacking(unposed, len(images), "images have no camera file and are left out"),
            *note_lacking(lacking, len(keyframes), "keyframes have no corrected camera and image and are left out"),
        ],
        left_out=note_lacking(blurred, len(cameras), f"frames have a blur_score below {least:g} and are left out"),
    ).scene()  # fmt: skip


def _calibration(camera: Fields) -> Calibration:
    """The intrinsics in a camera file; without a size if it states none."""
    size = camera.size("width", "height")
    fx, fy, cx, cy = (camera.required(key) for key in ("fx", "fy", "cx", "cy"))
    return Calibration((fx, fy), (cx, cy), size, camera.path, of_a_sensor=True)


def _pose(camera: Fields) -> FoundPose:
    """The pose in a camera file, with OpenCV axes."""
    rows = [[camera.required(f"t_{row}{column}") for column in range(4)] for row in range(3)]
    return FoundPose(np.array([*rows, [0, 0, 0, 1]]) * (1, -1, -1, 1), camera.path, "t_00")


def _sharpness(camera: Fields) -> float:
    """The `blur_score` of a camera file: high is sharp, as are images without a score."""
    score = camera.number("blur_score")
    return SHARP if score is None else score


def _depth(measured: DepthMap | None, camera_file: Stored | None, image: Stored | None) -> MapSource | None:
    """The source of a frame's depth; `camera_file` and `image` are those of the depth camera if it is not the one that is read. None if its size is unknown."""
    if measured is None or camera_file is None:
        return measured
    calibration = _calibration(read_fields(camera_file))
    size = calibration.size or (read_header(image).size if image is not None else None)
    return None if size is None else DepthThroughLens(measured, calibration.lens(camera_file, size))
