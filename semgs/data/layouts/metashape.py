"""Cameras of Agisoft Metashape (`Export Cameras` as XML) beside the photos.

A camera has the label of its photo (with or without ending) and a 4x4 matrix, camera to the chunk's world, with OpenCV's axes. A component may have a
transform with a scale from there to another world; it is applied. A sensor has its calibration: f, b1, b2 (skew), the principal point as an offset from
the middle of the image, k1 to k4, and p1 and p2, whose order is the reverse of OpenCV's. Fisheye lenses are equidistant. The unit of length is unknown.
In a rig, only cameras of the master have a matrix. Those of slaves are left out: nothing public says in which unit the offsets of their sensors are.
Metashape user manual, appendix D (camera models), and the XML that it writes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from semgs.data.cameras.fisheye import FisheyeLens
from semgs.data.cameras.lens import AbstractLens, Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.pose_files import checked_poses
from semgs.data.layouts.parts.usable_frames import PICTURES, note_lacking
from semgs.data.scene import Scene
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError, input_error
from semgs.files.images.pictures import is_turned, read_header
from semgs.runtime.notes import Kind

LAYOUT = "Metashape"
IMAGES = "images"
EXPECTED = "the cameras of Metashape as XML"
DISABLED = ("false", "0")
IN_A_RIG = "cameras are left out, as they are slaves of a rig, of which the file has no poses (export cameras as COLMAP, which has them)"
START = 4096

UNIT = Kind(
    "Metashape's unit of length is that of its chunk; if it is metres, use --unit metric.",
    "Metashape's unit of length is that of its chunk.",
)
"""Bytes in which the first elements are."""


def recognises(path: Path) -> bool:
    """Whether a path is such a file, or a folder with one, that has two poses or more."""
    file = _file(path)
    return file is not None and read_bytes(file, EXPECTED).count(b"<transform>") > 1


def open_metashape(path: Path) -> Scene:
    """The scene of Metashape's cameras; frames are in the order of the file.

    Args:
        path: the file, or its folder.

    Raises:
        InputError: the file is damaged, a lens is not supported, or fewer than two cameras have a pose and a photo.
    """
    file = _file(path) or path
    chunk = _read(file).find("chunk")
    if chunk is None:
        raise InputError(file, EXPECTED, "no chunk")
    sensors = {one.get("id", ""): one for one in chunk.iterfind("sensors/sensor")}
    components = {one.get("id", ""): _similarity(file, one) for one in chunk.iterfind("components/component")}
    every = list(chunk.iterfind("cameras//camera"))
    cameras = [one for one in every if one.get("enabled") not in DISABLED]
    disabled = [one.get("label", "") for one in every if one.get("enabled") in DISABLED]
    posed, unposed, slaves = list[ElementTree.Element](), list[str](), list[str]()
    for one in cameras:
        if (one.findtext("transform") or "").strip():
            posed.append(one)
        else:
            (unposed if one.get("master_id") is None else slaves).append(one.get("label", ""))
    labels = [one.get("label", "") for one in posed]
    _check_labels(file, labels)
    matrices = []
    for one, label in zip(posed, labels, strict=True):
        numbers = _numbers(file, one.findtext("transform"), f"camera {label}")
        if len(numbers) != 16:
            raise InputError(file, "the 16 numbers of a matrix", f"{len(numbers)}", f"camera {label}")
        pose, (scale, motion) = (
            np.reshape(numbers, (4, 4)),
            components.get(one.get("component_id", ""), (1.0, np.eye(4))),
        )
        pose[:3, 3] *= scale
        matrices.append(motion @ pose)
    poses = checked_poses(file, matrices, [f"camera {label}" for label in labels])
    lenses: dict[str, AbstractLens] = {}
    pictures = _pictures(file.parent)
    frames, absent = [], []
    for one, label, pose in zip(posed, labels, poses, strict=True):
        picture = _picture(file, pictures, label)
        if picture is None:
            absent.append(label)
            continue
        number = one.get("sensor_id", "")
        if number not in lenses:
            lenses[number] = _lens(file, sensors.get(number), number)
        is_turned(picture, read_header(picture), lenses[number].size)
        frames.append(Frame(picture.relative_to(file.parent).as_posix(), picture, lenses[number], pose))
    return Scene(
        path=path,
        name=file.absolute().parent.name,
        layout=LAYOUT,
        unit="unknown",
        frames=tuple(frames),
        absent=tuple(absent),
        notes=(
            UNIT(),
            *note_lacking(disabled, len(every), "cameras are disabled in Metashape and are left out"),
            *note_lacking(unposed, len(cameras), "cameras have no pose and are left out"),
            *note_lacking(slaves, len(cameras), IN_A_RIG),
            *note_lacking(absent, len(posed), f"photos of {file.name} are missing"),
        ),
    )


def _file(path: Path) -> Path | None:
    """The file of the cameras at a path, None if there is none."""
    files = [path] if path.is_file() else sorted(path.glob("*.xml")) if path.is_dir() else []
    for file in files:
        if file.suffix.lower() == ".xml" and file.is_file():
            with file.open("rb") as opened:
                start = opened.read(START)
            if b"<document" in start and b"<chunk" in start:
                return file
    return None


def _read(file: Path) -> ElementTree.Element:
    """The root of the XML. Files that define entities, which could be made to grow without end, are refused."""
    data = read_bytes(file, EXPECTED)
    try:
        text = data.decode("utf-8-sig")
        if "<!" in text.replace("<!--", ""):
            raise InputError(file, EXPECTED, "definitions (<!DOCTYPE or <!ENTITY)")
        return ElementTree.fromstring(text)  # from bytes, the parser would take the encoding that the file names
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(file, EXPECTED, f"damaged XML: {error}") from error


def _numbers(file: Path, text: str | None, place: str) -> list[float]:
    """The finite numbers in a text."""
    with input_error(file, "numbers", place):
        numbers = [float(word) for word in (text or "").split()]
    if not np.isfinite(numbers).all():
        raise InputError(file, "finite numbers", f"{(text or '').strip()[:60]}", place)
    return numbers


def _similarity(file: Path, component: ElementTree.Element) -> tuple[float, np.ndarray]:
    """Scale, and rigid motion after it, from a component to the world; nothing if the file has none."""
    place, motion = f"component {component.get('id')}", np.eye(4)
    turn, shift, scale = (_numbers(file, component.findtext(f"transform/{name}"), place) for name in ("rotation", "translation", "scale"))  # fmt: skip
    if (turn and len(turn) != 9) or (shift and len(shift) != 3) or (scale and (len(scale) != 1 or scale[0] <= 0)):
        raise InputError(file, "a rotation of 9 numbers, a translation of 3 and a positive scale", "others", place)
    if turn:
        motion[:3, :3] = np.reshape(turn, (3, 3))
    if shift:
        motion[:3, 3] = shift
    return (scale[0] if scale else 1.0), motion


def _name_in(label: str) -> str:
    """The name of a photo in a label, in lower case."""
    return label.replace("\\", "/").rpartition("/")[2].lower()


def _check_labels(file: Path, labels: Sequence[str]) -> None:
    """Refuse cameras with the same label, as photos of the same name in two folders have: nothing says which photo is whose.

    Raises:
        InputError: a label occurs twice.
    """
    again = [name for name, count in Counter(map(_name_in, labels)).items() if count > 1]
    if again:
        raise InputError(
            file,
            "a label of its own for each camera",
            f"{len(again)} that several cameras have, such as {next(one for one in labels if _name_in(one) == again[0])}",
            advice="give the photos different names and load them anew, or export each folder of photos by itself",
        )


@dataclass(frozen=True)
class _Photos:
    """Photos by their names in lower case, with and without ending."""

    by_name: dict[str, list[Path]]
    by_stem: dict[str, list[Path]]


def _pictures(folder: Path) -> list[_Photos]:
    """The photos of a folder, of `images` in it, and of its other folders together."""
    inside = sorted(one for one in folder.iterdir() if one.is_dir() and one.name != IMAGES)
    found = []
    for places in ([folder], [folder / IMAGES], inside):
        photos = _Photos({}, {})
        for file in (file for place in places if place.is_dir() for file in sorted(place.iterdir())):
            if file.suffix.lower() in PICTURES and file.is_file():
                photos.by_name.setdefault(file.name.lower(), []).append(file)
                photos.by_stem.setdefault(file.stem.lower(), []).append(file)
        found.append(photos)
    return found


def _picture(file: Path, pictures: Sequence[_Photos], label: str) -> Path | None:
    """The photo with a label, in the first of some places that has one; None if none has.

    Raises:
        InputError: a place has several, such as photos and masks of the same names in two folders.
    """
    for photos in pictures:
        found = photos.by_name.get(_name_in(label)) or photos.by_stem.get(_name_in(label), [])
        if len(found) > 1:
            shown = " and ".join(one.relative_to(file.parent).as_posix() for one in found[:2])
            raise InputError(file, f"one photo of camera {label}", shown, advice=f"put the photos into {IMAGES}/")
        if found:
            return found[0]
    return None


def _lens(file: Path, sensor: ElementTree.Element | None, number: str) -> AbstractLens:
    """The lens of a sensor."""
    place = f"sensor {number}"
    if sensor is None:
        raise InputError(file, "a sensor for each camera", "none", place)
    kind = sensor.get("type", "frame")
    if kind not in ("frame", "fisheye"):
        raise InputError(
            file, "a sensor of type frame or fisheye", kind, place, "undistort the photos in Metashape first"
        )
    calibrations = sorted(sensor.iterfind("calibration"), key=lambda one: one.get("class") != "adjusted")
    if not calibrations:
        raise InputError(file, "a calibration", "none", place, "align the photos first")
    resolution = sensor.find("resolution")
    resolution = calibrations[0].find("resolution") if resolution is None else resolution
    sides = {} if resolution is None else dict(resolution.items())
    width, height = (_whole(file, sides, side, place) for side in ("width", "height"))
    values: dict[str, float] = {}
    for name in ("f", "cx", "cy", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2"):
        numbers = _numbers(file, calibrations[0].findtext(name), f"{place}: {name}")
        values[name] = numbers[0] if numbers else 0.0
    focal, centre = (values["f"] + values["b1"], values["f"]), (width / 2 + values["cx"], height / 2 + values["cy"])
    fisheye, shear = kind == "fisheye", (values["p1"], values["p2"])
    if abs(values["b2"]) > 1 or (values["k4"] and not fisheye) or (fisheye and any(shear)):
        found = ", ".join(f"{name} = {values[name]:g}" for name in ("b2", "k4", "p1", "p2"))
        raise InputError(
            file,
            "a lens without skew (b2), k4 of a frame, and p1 and p2 of a fisheye",
            found,
            place,
            "undistort the photos first",
        )
    with input_error(file, "a possible camera", place):
        if fisheye:
            return FisheyeLens((height, width), focal, centre, (values["k1"], values["k2"], values["k3"], values["k4"]))
        return Lens(
            (height, width), focal, centre, (values["k1"], values["k2"], values["p2"], values["p1"], values["k3"])
        )


def _whole(file: Path, sides: Mapping[str, str], name: str, place: str) -> int:
    """A side of the images [px]."""
    text = sides.get(name, "")
    if not text.isascii() or not text.isdigit() or len(text) > 9 or int(text) < 1:
        raise InputError(file, f"{name} of the images in pixels", text[:20] or "nothing", place)
    return int(text)
