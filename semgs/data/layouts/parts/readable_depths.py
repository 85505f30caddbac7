"""Depth maps of kinds that are not read are left out, with a note, when a scene is opened: its images can be used without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from semgs.data.frames import Frame
from semgs.data.layouts.parts.usable_frames import note_lacking
from semgs.data.maps import DepthMap, DepthThroughLens
from semgs.data.scene import Scene
from semgs.files.contents import LFS_POINTER
from semgs.files.stored import Stored

_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
_HEADER = 26
"""Bytes of a PNG up to its bit depth and the kind of its colours."""
_BEGINNING = max(_HEADER, len(LFS_POINTER))


def without_unreadable_depth(scene: Scene) -> Scene:
    """A scene without the depth maps that are JPEG or PNG of other kinds than 16 bits of one channel, or pointers of Git LFS. Damaged ones stay, and are refused when they are read.

    Only headers are read: of all files, but of the first one inside an archive or recording.
    """
    faults: dict[int, str] = {}
    first: tuple[str | None] | None = None
    for index, frame in enumerate(scene.frames):
        file = _file(frame)
        if isinstance(file, Path):
            fault = fault_of_depth(file)
        elif file is not None:
            first = first or (fault_of_depth(file),)
            fault = first[0]
        else:
            continue
        if fault is not None:
            faults[index] = fault
    if not faults:
        return scene
    frames = tuple(replace(one, depth=None) if index in faults else one for index, one in enumerate(scene.frames))
    kinds = ", ".join(sorted(set(faults.values())))
    notes = note_lacking(
        _names(scene.frames, faults),
        len(frames),
        f"depth maps are left out, as they are {kinds}, not 16 bits of one channel",
    )
    return replace(scene, frames=frames, notes=(*scene.notes, *notes))


def _names(frames: Sequence[Frame], chosen: dict[int, str]) -> list[str]:
    """The names of the chosen frames' depth maps."""
    return [file.name for index in chosen if (file := _file(frames[index])) is not None]


def _file(frame: Frame) -> Stored | None:
    """The PNG of a frame's depth, None if it has none."""
    depth = frame.depth.map if isinstance(frame.depth, DepthThroughLens) else frame.depth
    return depth.path if isinstance(depth, DepthMap) and depth.path.suffix.lower() == ".png" else None


def fault_of_depth(file: Stored) -> str | None:
    """What a file of another kind than depth is, None if it is depth, damaged or missing."""
    try:
        if isinstance(file, Path):
            with file.open("rb") as opened:
                start = opened.read(_BEGINNING)
        else:
            start = file.read_bytes()[:_BEGINNING]
    except OSError:
        return None
    if start.startswith(LFS_POINTER):
        return "Git LFS pointers (run git lfs pull)"
    if start[:2] == _JPEG:
        return "JPEG"
    if start[:8] != _PNG or len(start) < _HEADER:
        return None
    bits, colours = start[24], start[25]
    if bits == 16 and colours == 0:
        return None
    return f"PNG of {bits} bits" + ("" if colours in (0, 3) else " in colour")
