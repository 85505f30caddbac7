"""Names and fingerprints of the scenes of a batch."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from semgs.batch.tasks import Demands, fingerprint, scene_names
from semgs.runtime.kept import stamps


def test_a_name_takes_as_many_folders_as_tell_it_from_others():
    paths = [Path("/a/x/room"), Path("/a/y/room"), Path("/a/hall"), Path("/b/x/room")]
    assert scene_names(paths) == ["a_x_room", "y_room", "hall", "b_x_room"]
    with pytest.raises(ValueError, match="room is given twice"):
        scene_names([Path("/room"), Path("/room")])


def test_files_of_one_name_are_called_as_their_folders(tmp_path: Path):
    paths = [tmp_path / name / "transforms.json" for name in ("hall", "attic")]
    for path in paths:
        path.parent.mkdir()
        path.touch()
        path.with_name("splat.ply").touch()
    assert scene_names(paths) == ["hall", "attic"]
    assert scene_names(paths[:1]) == ["hall"]
    assert scene_names([path.with_name("splat.ply") for path in paths]) == ["hall", "attic"]
    assert scene_names([paths[0].with_name("splat.ply")]) == ["splat"]


def test_files_that_differ_only_in_their_ending_keep_it(tmp_path: Path):
    """Two files of one name were refused as one that is given twice."""
    (tmp_path / "a").mkdir()
    for name in ("a.mp4", "b.mp4", "b.mov"):
        (tmp_path / name).touch()
    paths = [tmp_path / name for name in ("a", "a.mp4", "b.mp4", "b.mov")]
    assert scene_names(paths) == ["a", "a_mp4", "b_mp4", "b_mov"]
    assert scene_names(paths[2:]) == ["b_mp4", "b_mov"]
    assert scene_names(paths[1:3]) == ["a", "b"]
    with pytest.raises(ValueError, match="b_mp4 is given twice"):
        scene_names([paths[2], paths[2]])


def test_a_fingerprint_changes_with_options_with_files_and_with_what_options_name(tmp_path: Path):
    (tmp_path / "scene").mkdir()
    photo, weights = tmp_path / "scene" / "a.jpg", tmp_path / "w.safetensors"
    photo.write_bytes(b"123")
    weights.write_bytes(b"1")

    def print_of(*options: str) -> str:
        return fingerprint(options, [tmp_path / "scene"])

    options = ("--weights", str(weights), "--views", "3")
    first = print_of(*options)
    assert print_of(*options) == first
    assert print_of(*options[:2]) != first
    changed = photo.stat().st_mtime_ns
    photo.write_bytes(b"1234")
    os.utime(photo, ns=(changed, changed))
    larger = print_of(*options)
    assert larger != first
    joined = print_of(f"--weights={weights}")
    weights.write_bytes(b"12")
    assert print_of(*options) != larger
    assert print_of(f"--weights={weights}") != joined
    assert print_of("--words", 300 * "x") != print_of("--words", 301 * "x")  # longer than the name of a file can be


@pytest.mark.parametrize("joint", [" ", "="])
def test_a_file_that_the_command_writes_is_none_of_its_inputs(tmp_path: Path, joint: str):
    """It is not there before the first run, and is when the command is repeated to resume."""
    written = tmp_path / "walk.rrd"
    options = ("reconstruct", *f"--rerun{joint}{written}".split(), "--all")
    before = fingerprint(options, [])
    written.write_bytes(b"RRF")
    assert fingerprint(options, []) == before
    assert fingerprint(("reconstruct", "--depth", str(written), "--all"), []) != before


def test_the_photos_beside_a_transforms_json_count(tmp_path: Path):
    cameras, photo = tmp_path / "transforms.json", tmp_path / "0.jpg"
    cameras.write_text("{}")
    before = fingerprint((), [cameras])
    photo.write_bytes(b"1")
    assert fingerprint((), [cameras]) != before


@pytest.mark.parametrize("given", ["cameras", "cameras/transforms.json", "cameras/fixed.json"])
def test_photos_elsewhere_that_a_transforms_json_names_count_and_others_do_not(tmp_path: Path, given: str):
    """As `semgs doctor --fix` writes one: it lists the photos where they are."""
    scene = tmp_path / given
    file = scene / "transforms.json" if scene.suffix == "" else scene
    file.parent.mkdir()
    file.write_text(
        json.dumps({"camera_model": "OPENCV", "frames": [{"file_path": "..\\images\\0.png"}, {"file_path": 300 * "x"}]})
    )
    (tmp_path / "images").mkdir()
    prints = [fingerprint((), [scene])]
    for name in ("0.png", "1.png"):
        (tmp_path / "images" / name).write_bytes(b"1")
        prints.append(fingerprint((), [scene]))
    assert prints[0] != prints[1] == prints[2]
    file.write_text("{")
    assert fingerprint((), [scene]) != prints[2]


def test_photos_behind_a_link_count_and_a_link_that_leads_back_ends(tmp_path: Path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "images").symlink_to(tmp_path / "photos")
    (tmp_path / "photos" / "back").symlink_to(tmp_path / "scene")
    before = fingerprint((), [tmp_path / "scene"])
    (tmp_path / "photos" / "0.png").write_bytes(b"1")
    assert [name for name, *_ in stamps(tmp_path / "scene")] == ["scene/images/0.png"]
    assert fingerprint((), [tmp_path / "scene"]) != before


@pytest.mark.parametrize(
    ("demands", "workers"),
    [(Demands(1e9), 8), (Demands(3e9), 5), (Demands(99e9), 1), (Demands(1e9, 0.3), 3), (Demands(1e9, 1.0), 1)],
)
def test_workers_follow_from_cores_memory_and_gpu(demands: Demands, workers: int):
    assert demands.workers(8, 16e9) == workers


def test_another_version_of_semgs_is_another_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """So a batch that is resumed after an update does not keep results of the old one beside new ones."""
    before = fingerprint(("reconstruct",), [tmp_path])
    monkeypatch.setattr("semgs.batch.tasks.__version__", "99.0")
    assert fingerprint(("reconstruct",), [tmp_path]) != before
