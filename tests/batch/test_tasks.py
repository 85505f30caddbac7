"""Names and fingerprints of the scenes of a batch."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from semgs.batch.tasks import make_task, scene_names


def test_a_name_takes_as_many_folders_as_tell_it_from_others():
    paths = [Path("/a/x/room"), Path("/a/y/room"), Path("/a/hall"), Path("/b/x/room")]
    assert scene_names(paths) == ["a_x_room", "y_room", "hall", "b_x_room"]
    with pytest.raises(ValueError, match="room is given twice"):
        scene_names([Path("/room"), Path("/room")])


def test_a_fingerprint_changes_with_options_with_files_and_with_what_options_name(tmp_path: Path):
    (tmp_path / "scene").mkdir()
    photo, weights = tmp_path / "scene" / "a.jpg", tmp_path / "w.safetensors"
    photo.write_bytes(b"123")
    weights.write_bytes(b"1")

    def print_of(*options: str) -> str:
        return make_task("scene", ["reconstruct"], options, [tmp_path / "scene"]).fingerprint

    options = ("--weights", str(weights), "--views", "3")
    first = print_of(*options)
    assert print_of(*options) == first
    assert print_of(*options[:2]) != first
    changed = photo.stat().st_mtime_ns
    photo.write_bytes(b"1234")
    os.utime(photo, ns=(changed, changed))
    larger = print_of(*options)
    assert larger != first
    weights.write_bytes(b"12")
    assert print_of(*options) != larger
