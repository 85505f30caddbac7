"""ScanNet: what is written in its files is what is read, from recordings and from what exporters leave of them."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zlib
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

pytest.importorskip("embreex")

from cast_room import miniature, pinhole_rays, poses
from scannet_writer import (
    COLOUR_K,
    COLOUR_SIZE,
    DEPTH_K,
    DEPTH_SIZE,
    Scan,
    label_zip,
    matrix_text,
    png,
    scan,
    sens,
    tsv,
    write_extracted,
    write_raw,
)
from traced_memory import most_memory

from semgs.cli.main import main
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene, open_scenes
from semgs.files.errors import InputError
from semgs.geometry.cameras import project


@pytest.fixture(scope="module")
def written() -> Scan:
    return scan()


@pytest.fixture(scope="module")
def raw(written, tmp_path_factory) -> Path:
    return write_raw(tmp_path_factory.mktemp("raw data"), written)


@pytest.fixture(scope="module")
def extracted(written, tmp_path_factory) -> Path:
    return write_extracted(tmp_path_factory.mktemp("extracted data"), written)


@pytest.fixture
def copied(raw, tmp_path) -> Path:
    """A raw scan to spoil."""
    return Path(shutil.copytree(raw.parent.parent, tmp_path / "data")) / "scans" / raw.name


def brought(depth: np.ndarray) -> np.ndarray:
    """Depth in the colour camera, pixel by pixel: along the ray of a colour pixel, in what depth pixel that comes out [m]."""
    result = np.zeros(COLOUR_SIZE, np.float32)
    for row in range(COLOUR_SIZE[0]):
        for column in range(COLOUR_SIZE[1]):
            x = (column - COLOUR_K[0, 2]) / COLOUR_K[0, 0] * DEPTH_K[0, 0] + DEPTH_K[0, 2]
            y = (row - COLOUR_K[1, 2]) / COLOUR_K[1, 1] * DEPTH_K[1, 1] + DEPTH_K[1, 2]
            i, j = int(np.floor(y + 0.5)), int(np.floor(x + 0.5))
            if 0 <= i < DEPTH_SIZE[0] and 0 <= j < DEPTH_SIZE[1]:
                result[row, column] = depth[i, j] / 1000
    return result


@cache
def depths_of(written: Scan) -> np.ndarray:
    """The depths that have to be read."""
    return np.stack([brought(depth) for depth in written.depths])


def check_equal(scene: Scene, written: Scan, labelled: bool = True) -> None:
    """What a scene reads is what was written."""
    views = scene.read(range(len(scene)), "native")
    assert len(scene) == len(written.posed)
    torch.testing.assert_close(
        views.cameras.world_from_camera, torch.from_numpy(written.poses[written.posed]), atol=1e-6, rtol=0
    )
    pixels = (views.images * 255).round().byte().permute(0, 2, 3, 1).numpy()
    assert np.array_equal(pixels, written.images[written.posed])
    np.testing.assert_allclose(views.depths.numpy(), depths_of(written)[written.posed], atol=5e-4)
    if labelled:
        assert (views.labels.numpy() == written.labels[written.posed]).all()
        assert views.classes.name == "scannet20"
    else:
        assert views.labels is None


def test_a_recording_is_read_as_it_was_written(raw, written):
    scene = open_scene(raw)
    check_equal(scene, written)
    assert (scene.name, scene.layout, scene.unit, scene.frames[2].name) == (
        "scene0000_00",
        "ScanNet",
        "metric",
        "color/3.jpg",
    )
    assert scene.notes == (
        "2 of 6 frames are without a finite pose (tracking was lost) and are left out, the first is color/2.jpg.",
    )
    assert open_scene(raw / "scene0000_00.sens").name == "scene0000_00"
    assert [one.name for one in open_scenes(raw.parent)] == ["scene0000_00"]


def test_depth_in_fifths_of_a_millimetre_is_read_as_it_was_written(written, tmp_path):
    finer = replace(written, depths=5 * written.depths)
    (tmp_path / "scene.sens").write_bytes(sens(finer, shift=5000.0))
    check_equal(open_scene(tmp_path / "scene.sens"), written, labelled=False)


def test_what_the_exporter_left_is_read_as_it_was_written(extracted, written):
    scene = open_scene(extracted)
    check_equal(scene, written)
    assert [frame.name for frame in scene.frames] == [f"color/{number}.jpg" for number in (0, 1, 3, 5)]


def test_depth_that_is_brought_to_the_colour_camera_lies_on_the_room(raw):
    views = open_scene(raw).read([0], "native")
    truth = miniature().photograph(poses()[0], pinhole_rays(COLOUR_SIZE, COLOUR_K, 0)).depth / 1000
    off = np.abs(views.depths[0].numpy() - truth)[views.depths[0].numpy() > 0]
    assert np.median(off) < 0.02  # two pixels of colour share one of depth, and walls go on by as much between them
    assert np.mean(off < 0.1) > 0.9


def test_a_point_is_where_scannets_own_formula_puts_it(raw, extracted):
    point = np.array([0.4, 0.7, 0.8])
    for scene in (open_scene(raw), open_scene(extracted)):
        seen = np.linalg.inv(poses()[1]) @ np.append(point, 1)
        u, v, _ = COLOUR_K @ seen[:3] / seen[2]  # the centre of the first pixel is 0 there, 0.5 here
        ours = project(torch.from_numpy(point)[None], scene.cameras[1])[0]
        np.testing.assert_allclose(ours.numpy(), [u + 0.5, v + 0.5, seen[2]], atol=1e-4)


@pytest.mark.parametrize("digits", [0, 6])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_numbers_may_have_zeros_before_them_and_lines_may_end_as_in_windows(written, tmp_path, digits, end):
    folder = write_extracted(tmp_path, written, digits=digits, end=end)
    scene = open_scene(folder)
    check_equal(scene, written)
    assert scene.index("3".zfill(digits)) == 2


def test_ten_comes_behind_nine(written, tmp_path):
    folder = write_extracted(tmp_path, written)
    for place, ending in (("color", "jpg"), ("depth", "png"), ("pose", "txt"), ("label-filt", "png")):
        (folder / place / f"1.{ending}").rename(folder / place / f"10.{ending}")
    assert [frame.name for frame in open_scene(folder).frames] == [
        "color/0.jpg",
        "color/3.jpg",
        "color/5.jpg",
        "color/10.jpg",
    ]


def test_labels_are_found_unzipped_in_a_folder_of_their_own_or_zipped(written, tmp_path):
    folder = write_extracted(tmp_path, written)
    (folder / "scene0000_00_2d-label-filt").mkdir()
    (folder / "label-filt").rename(folder / "scene0000_00_2d-label-filt" / "label-filt")
    check_equal(open_scene(folder), written)
    shutil.rmtree(folder / "scene0000_00_2d-label-filt")
    label_zip(folder / "scene0000_00_2d-label-filt.zip", written)
    check_equal(open_scene(folder), written)


def test_the_subset_of_25k_frames_has_nyu40_in_its_labels(written, tmp_path):
    folder = write_extracted(tmp_path, written, digits=6, labels="label")
    raw_ids = np.array((1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 24, 28, 33, 34, 36, 39), np.uint8)
    for number, labels in enumerate(written.labels):
        nyu40 = np.where(labels == 255, 22, raw_ids[np.minimum(labels, 19)]).astype(np.uint8)
        (folder / "label" / f"{number:06d}.png").write_bytes(png(nyu40))
    (tmp_path / "scannetv2-labels.combined.tsv").unlink()
    for camera in ("color", "depth"):
        (folder / "intrinsic" / f"intrinsic_{camera}.txt").rename(folder / f"intrinsics_{camera}.txt")
    scene = open_scene(folder)
    check_equal(scene, written)
    assert any("NYU40" in note for note in scene.notes)


def flattened(folder: Path, place: str, depth: str, written: Scan) -> None:
    """The files of the exporter in Python named as the one in C++ names them."""
    (folder / place).mkdir(exist_ok=True)
    for number in range(len(written.jpegs)):
        for kind, ending in (("color", "jpg"), ("depth", "png"), ("pose", "txt")):
            new = folder / place / f"frame-{number:06d}.{kind}.{ending}"
            (folder / kind / f"{number}.{ending}").rename(new)
        if depth == "pgm":
            rows, columns = written.depths[number].shape
            data = written.depths[number].astype(">u2").tobytes()
            header = f"P5\n# data values are 16-bit each; depth shift is 1000\n{columns} {rows}\n65535\n".encode()
            new.with_name(f"frame-{number:06d}.depth.pgm").write_bytes(header + data)
            new.with_name(f"frame-{number:06d}.depth.png").unlink()
    for kind in ("color", "depth", "pose"):
        (folder / kind).rmdir()


def test_the_exporter_in_cpp_names_its_files_in_another_way(written, tmp_path):
    folder = write_extracted(tmp_path / "a", written)
    flattened(folder, "sensor_data", "png", written)
    check_equal(open_scene(folder), written)
    folder = write_extracted(tmp_path / "b", written)
    flattened(folder, "", "pgm", written)
    shutil.rmtree(folder / "intrinsic")
    lines = ["m_versionNumber = 4", "m_sensorName = StructureSensor", "m_colorWidth = 162", "m_colorHeight = 121"]
    for camera, k in (("Color", COLOUR_K), ("Depth", DEPTH_K)):
        full = np.eye(4)
        full[:3, :3] = k
        lines.append(f"m_calibration{camera}Intrinsic = " + " ".join(f"{value:.6f}" for value in full.ravel()) + " ")
    (folder / "_info.txt").write_text("\r\n".join(lines) + "\r\n")
    check_equal(open_scene(folder), written)


def test_a_size_of_very_many_digits_is_none(written, tmp_path):
    folder = write_extracted(tmp_path, written)
    (folder / "_info.txt").write_text(f"m_colorWidth = {5000 * '1'}\nm_colorHeight = 121\n")
    check_equal(open_scene(folder), written)


def test_frames_without_labels_or_depth_or_pose_are_counted(written, tmp_path):
    folder = write_extracted(tmp_path, written)
    (folder / "label-filt" / "1.png").unlink()
    (folder / "depth" / "3.png").unlink()
    (folder / "depth" / "5.png").unlink()
    (folder / "pose" / "0.txt").unlink()
    scene = open_scene(folder)
    assert scene.notes == (
        "3 of 6 frames are without a finite pose (tracking was lost) and are left out, the first is color/0.jpg.",
        "2 of 3 frames are without depth, the first is color/3.jpg.",
        "1 of 3 frames are without labels, the first is color/1.jpg.",
    )
    assert scene.read([1, 2], "native").labels is not None
    assert scene.read([0, 1], "native").labels is None
    assert scene.read([0], "native").depths is not None


def test_without_labels_colour_and_depth_are_read_and_it_is_said(raw, written, copied, tmp_path):
    (copied / "scene0000_00_2d-label-filt.zip").unlink()
    scene = open_scene(copied)
    check_equal(scene, written, labelled=False)
    assert scene.classes is None
    assert scene.notes[-1].startswith("There are no labels (label-filt/ or SCAN_2d-label-filt.zip)")


def test_labels_without_their_table_are_not_read_and_it_is_said(copied, written):
    (copied.parent.parent / "scannetv2-labels.combined.tsv").unlink()
    scene = open_scene(copied)
    check_equal(scene, written, labelled=False)
    assert "scannetv2-labels.combined.tsv is neither" in scene.notes[-1]


def test_pictures_that_were_resized_get_the_intrinsics_resized(written, tmp_path):
    folder = write_extracted(tmp_path, written)
    k = COLOUR_K.copy()
    k[:2] *= 8  # of pictures of 968 rows and 1296 columns
    k[:2, 2] += 3.5
    (folder / "intrinsic" / "intrinsic_color.txt").write_bytes(matrix_text(k))
    for path in (folder / "color").iterdir():
        Image.open(path).resize((80, 60)).save(path)
    camera = open_scene(folder).cameras[0]
    assert camera.size == (60, 80)
    expected = [k[0, 0] * 80 / 1296, (k[0, 2] + 0.5) * 80 / 1296, k[1, 1] * 60 / 968, (k[1, 2] + 0.5) * 60 / 968]
    np.testing.assert_allclose(camera.intrinsics.numpy()[[0, 0, 1, 1], [0, 2, 1, 2]], expected, rtol=1e-6)


def test_the_peers_972_rows_are_a_named_choice(tmp_path, written):
    """K times 320/1296 in both rows, as S-Ray and GSNeRF have it at 320x240; the truth is 240/968 below."""
    full = (968, 1296)
    folder = write_extracted(tmp_path, written, labels=None)
    k = np.array([[1170.187988, 0, 647.75], [0, 1170.187988, 483.75], [0, 0, 1]])
    (folder / "intrinsic" / "intrinsic_color.txt").write_bytes(matrix_text(k))
    Image.new("RGB", full[::-1]).save(folder / "color" / "0.jpg")
    ours = open_scene(folder).read([0], size=(240, 320)).cameras[0].intrinsics.numpy()
    peers = open_scene(folder, as_peers=["rows-972"])
    theirs = peers.read([0], size=(240, 320)).cameras[0].intrinsics.numpy()
    np.testing.assert_allclose(theirs[1], [0, k[1, 1] * 320 / 1296, (k[1, 2] + 0.5) * 320 / 1296], rtol=1e-9)
    np.testing.assert_allclose(ours[1], [0, k[1, 1] * 240 / 968, (k[1, 2] + 0.5) * 240 / 968], rtol=1e-9)
    np.testing.assert_allclose(ours[0], theirs[0])
    assert "rows" in peers.notes[-1]
    for path in (folder / "color").iterdir():
        Image.new("RGB", (640, 480)).save(path)  # resized by the exporter
    resized = open_scene(folder, as_peers=["rows-972"]).read([0], size=(240, 320)).cameras[0].intrinsics.numpy()
    np.testing.assert_allclose(resized, theirs)


def test_the_peers_cameras_do_not_move_depth_in_the_pictures(raw, written):
    scene = open_scene(raw, as_peers=["rows-972"])
    np.testing.assert_allclose(scene.read([0], "native").depths[0].numpy(), depths_of(written)[0], atol=5e-4)
    k = scene.cameras[0].intrinsics.numpy()
    np.testing.assert_allclose(k[1], [0, COLOUR_K[1, 1] * 968 / 972, (COLOUR_K[1, 2] + 0.5) * 968 / 972], rtol=1e-6)


def test_gsnerfs_labels_are_a_named_choice(raw, written):
    ours, theirs = (
        open_scene(raw, as_peers=chosen).read([0], "native").labels[0].numpy() for chosen in ((), ("gsnerf-labels",))
    )
    assert {label for label in np.unique(ours)} >= {0, 1, 255}
    assert (theirs == np.where(ours == 19, 6, np.where(ours == 255, 19, ours))).all()


def test_readings_that_do_not_exist_or_are_of_another_layout_are_refused(raw, shared):
    with pytest.raises(ValueError, match="unknown reading 'gsnerf'; known: rows-972, gsnerf-labels"):
        open_scene(raw, as_peers=["gsnerf"])
    with pytest.raises(InputError, match=r"a scene for the reading rows-972 .*, found transforms\.json"):
        open_scene(shared / "data" / "fox", as_peers=["rows-972"])


def test_a_truncated_recording_gives_the_frames_before_the_cut(copied, written):
    path = copied / "scene0000_00.sens"
    whole = path.read_bytes()
    last = len(written.jpegs[-1])
    for cut in (whole[: -last // 2], whole[: -last - 900], whole[: len(whole) * 9 // 10] + bytes(len(whole) // 10)):
        path.write_bytes(cut)
        scene = open_scene(copied)
        assert len(scene) == 3  # of five complete frames two have no pose
        assert scene.notes[0] == "scene0000_00.sens is truncated: 5 of the 6 frames in its header are complete."
        assert scene.read([0, 1, 2], "native").depths is not None


def test_a_header_that_claims_2_to_the_40_frames_allocates_nothing(tmp_path, written):
    path = tmp_path / "scene.sens"
    path.write_bytes(sens(written, declared=1 << 40))
    scene = open_scene(path)
    assert len(scene) == 4
    assert most_memory(lambda: open_scene(path)) < 1_000_000
    assert "6 of the 1099511627776 frames" in scene.notes[0]


def test_of_a_recording_of_very_many_frames_the_first_are_read(tmp_path, written, monkeypatch):
    monkeypatch.setattr("semgs.data.layouts.scannet.sens.MOST_FRAMES", 5)
    path = tmp_path / "scene.sens"
    path.write_bytes(sens(written, declared=6))
    assert "5 of the 6 frames" in open_scene(path).notes[0]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"version": 3}, r"scene\.sens: version: expected a \.sens file of version 4, found 3"),
        ({"colour_codec": 1}, r"codec of colour: expected jpeg, found png"),
        ({"colour_codec": 0}, r"codec of colour: expected jpeg, found raw"),
        ({"depth_codec": 0}, r"codec of depth: expected zlib_ushort, found raw_ushort"),
        ({"depth_codec": 2}, r"codec of depth: expected zlib_ushort, found occi_ushort"),
        ({"depth_codec": 9}, r"codec of depth: expected zlib_ushort, found number 9"),
        ({"shift": 0.0}, r"depth shift: expected a positive number"),
        ({"colour_size": (0, 162)}, r"size of colour"),
        (
            {"depth_extrinsic": np.eye(4) + np.eye(4, k=3) * 0.03},
            r"extrinsic of depth: expected depth aligned with colour .*calibrate",
        ),
    ],
)
def test_recordings_of_another_kind_are_refused_by_name(tmp_path, written, changed, message):
    path = tmp_path / "scene.sens"
    path.write_bytes(sens(written, **changed))
    with pytest.raises(InputError, match=message):
        open_scene(path)


@pytest.mark.parametrize("length", [0, 3, 11, 20, 200, 400])
def test_a_recording_that_ends_in_its_header_or_first_frame_is_refused(tmp_path, written, length):
    path = tmp_path / "scene.sens"
    path.write_bytes(sens(written)[:length])
    with pytest.raises(InputError, match=r"ends in its header|at least two complete frames, found 0 of the 6"):
        open_scene(path)


def test_any_file_can_call_itself_a_recording(tmp_path):
    rng = np.random.default_rng(1)
    for length in (1, 50, 5000):
        (tmp_path / "x.sens").write_bytes(rng.integers(0, 256, length, dtype=np.uint8).tobytes())
        with pytest.raises(InputError):
            open_scene(tmp_path / "x.sens")


def test_a_damaged_frame_is_named_when_it_is_read(copied, written):
    path = copied / "scene0000_00.sens"
    whole = bytearray(path.read_bytes())
    place = whole.index(written.jpegs[1])
    whole[place : place + 40] = bytes(40)
    path.write_bytes(whole)
    with pytest.raises(InputError, match=r"scene0000_00\.sens, colour of frame 1: expected a JPEG or PNG"):
        open_scene(copied).read([1], "native")
    behind = place + len(written.jpegs[1])
    whole = bytearray(sens(written))
    whole[behind : behind + 40] = bytes(40)
    path.write_bytes(whole)
    with pytest.raises(
        InputError, match=r"depth of frame 1: expected an array of numbers, found depth that cannot be decompressed"
    ):
        open_scene(copied).read([1], "native")


def test_depth_of_another_size_than_its_header_says_is_refused(tmp_path, written):
    for height in (59, 61):
        other = Scan(
            written.poses, written.jpegs, np.resize(written.depths, (6, height, 80)), written.ids, written.labels
        )
        (tmp_path / "scene.sens").write_bytes(sens(other, depth_size=DEPTH_SIZE))
        with pytest.raises(InputError, match=r"depth of frame 0: .* bytes of depth, not the 9600 of 80x60"):
            open_scene(tmp_path / "scene.sens").read([0], "native")


def test_a_zip_that_lacks_members_is_counted_and_a_damaged_one_refused(copied, written):
    path = copied / "scene0000_00_2d-label-filt.zip"
    label_zip(path, written, leave_out=(1, 5))
    scene = open_scene(copied)
    assert scene.notes[-1] == "2 of 4 frames are without labels, the first is color/1.jpg."
    assert scene.read([0, 2], "native").labels is not None
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(InputError, match=r"_2d-label-filt\.zip: expected a zip archive"):
        open_scene(copied)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            b"category\tcount\tnyuId\tnyu40id\nwall\t1\t2\t1\n",
            r"\.tsv: id: expected ScanNet's .*, found columns category, count",
        ),
        (tsv().replace(b"nyu40id", b"mpcat40"), r"\.tsv: nyu40id: expected"),
        (b"", r"found an empty file"),
        (
            tsv().replace(b"56\ttrash can", b"5x\ttrash can"),
            r"line 21, id: expected a whole number 1\.\.65535, found '5x'",
        ),
        (tsv().replace(b"\t39\t", b"\t41\t"), r"line 21, nyu40id: expected a whole number 0\.\.40, found '41'"),
        (tsv().replace(b"56\ttrash can", 5000 * b"5" + b"\ttrash can"), r"line 21, id: expected .*, found '5{59}"),
        (b"\xff\xfe\x00", r"a table in UTF-8"),
    ],
)
def test_another_table_is_refused_with_path_and_column(copied, content, message):
    (copied.parent.parent / "scannetv2-labels.combined.tsv").write_bytes(content)
    with pytest.raises(InputError, match=message):
        open_scene(copied)
    scene = open_scene(copied, needs_labels=False)
    assert scene.classes is None
    assert re.search(f"^The labels are left out: .*{message}", scene.notes[-1])


def spoil(folder: Path, name: str, content: bytes | None) -> None:
    """Exchange a file, or remove it."""
    path = folder / name
    path.unlink()
    if content is not None:
        path.write_bytes(content)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (
            "pose/1.txt",
            b"1 0 0\n0 1 0\n",
            r"pose/1\.txt: expected a camera-to-world matrix .*found 2 lines of \[3\] numbers",
        ),
        ("pose/1.txt", b"one two", r"pose/1\.txt: line 1: expected numbers"),
        ("pose/1.txt", matrix_text(2 * np.eye(4)), r"pose of color/1\.jpg: expected a 4x4 camera-to-world"),
        (
            "intrinsic/intrinsic_color.txt",
            b"1 2 3",
            r"intrinsic_color\.txt: expected intrinsics as a 3x3 or 4x4 matrix .*found 3 numbers",
        ),
        ("intrinsic/intrinsic_color.txt", None, r"intrinsics of the colour camera"),
        (
            "intrinsic/intrinsic_color.txt",
            matrix_text(np.diag((140.0, 140, 1, 1))),
            r"expected intrinsics for images of 162x121 .* found a principal point at \(0, 0\)",
        ),
        ("intrinsic/intrinsic_depth.txt", matrix_text(-DEPTH_K + np.diag((0, 0, 2.0)) + 80), r"intrinsic_depth\.txt"),
        ("color/0.jpg", b"", r"color/0\.jpg"),
    ],
)
def test_broken_files_of_an_exporter_are_named(written, tmp_path, name, content, message):
    folder = write_extracted(tmp_path, written)
    spoil(folder, name, content)
    with pytest.raises(InputError, match=message):
        open_scene(folder)


def test_two_files_of_one_number_are_refused(written, tmp_path):
    folder = write_extracted(tmp_path, written)
    shutil.copy(folder / "color" / "1.jpg", folder / "color" / "01.jpg")
    with pytest.raises(InputError, match=r"one file of each number, found 01\.jpg and 1\.jpg"):
        open_scene(folder)


def test_a_scan_that_lost_track_is_refused_with_counts(tmp_path):
    (tmp_path / "scene.sens").write_bytes(sens(scan(lost=(0, 1, 2, 3, 5))))
    with pytest.raises(InputError, match=r"at least two frames with an image and a finite pose, found 1 of 6"):
        open_scene(tmp_path / "scene.sens")


def test_filtered_labels_of_8_bits_are_refused_for_they_may_be_anything(written, tmp_path):
    folder = write_extracted(tmp_path, written)
    for path in (folder / "label-filt").iterdir():
        path.write_bytes(png(np.asarray(Image.open(path)).astype(np.uint8)))
    with pytest.raises(InputError, match=r"label-filt/0\.png: expected 16-bit ids, as ScanNet has them, found 8 bits"):
        open_scene(folder)


def test_a_label_map_of_another_shape_is_refused_when_it_is_read(written, tmp_path):
    folder = write_extracted(tmp_path, written)
    (folder / "label-filt" / "0.png").write_bytes(png(written.ids[0][:, ::3]))
    with pytest.raises(InputError, match=r"label-filt/0\.png: expected 162x121 pixels"):
        open_scene(folder).read([0], "native")


def test_the_command_line_ends_with_2_and_one_line(copied, capsys, tmp_path):
    (copied / "scene0000_00.sens").write_bytes(b"not a recording")
    assert main(["reconstruct", str(copied), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert len(told) == 1
    assert "scene0000_00.sens" in told[0]
    assert not (tmp_path / "out").exists()


def long_recording(path: Path, written: Scan, frames: int, bytes_each: int) -> None:
    """A recording of many frames, each padded with a hole to so many bytes: no disk is filled."""
    head = sens(written, declared=frames)
    start = head.index(written.jpegs[0]) - 96
    packed = zlib.compress(written.depths[0].astype("<u2").tobytes())
    colour = bytes_each - 96 - len(packed)
    with path.open("wb") as file:
        file.write(head[:start])
        for number in range(frames):
            file.write(
                head[start : start + 64] + bytes(16) + colour.to_bytes(8, "little") + len(packed).to_bytes(8, "little")
            )
            file.write(written.jpegs[number % 2])
            file.seek(colour - len(written.jpegs[number % 2]), 1)
            file.write(packed)


READING = """
import resource, sys, tracemalloc
from semgs.data.scenes import open_scene

open_scene(sys.argv[1]).read([0, 1], "native")  # what is loaded and set up once
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
tracemalloc.start()
scene = open_scene(sys.argv[2])
for start in range(0, len(scene), 64):
    scene.read([start, start + 1], "native")
grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
print(len(scene), grown / 1024, tracemalloc.get_traced_memory()[1] / 2**20)
"""


@pytest.mark.long
def test_a_recording_of_2_gigabytes_is_read_in_less_than_200_megabytes(tmp_path, written):
    frames = 2048
    long_recording(tmp_path / "small.sens", written, 4, 20_000)
    long_recording(tmp_path / "large.sens", written, frames, 1 << 20)
    assert (tmp_path / "large.sens").stat().st_size > 2_000_000_000
    command = [sys.executable, "-c", READING, str(tmp_path / "small.sens"), str(tmp_path / "large.sens")]
    told = subprocess.run(command, capture_output=True, text=True, check=True)
    count, resident, allocated = told.stdout.split()
    assert int(count) == frames
    assert max(float(resident), float(allocated)) < 200


def test_files_of_macos_beside_a_recording_are_ignored(copied: Path):
    """Its recording, and the zip file of its label maps."""
    for one in [*copied.glob("*.sens"), *copied.glob("*.zip")]:
        (copied / f"._{one.name}").write_bytes(b"\0\5\26\7Mac OS X")
    scene = open_scene(copied)
    assert (len(scene), scene.name) == (len(open_scene(copied / "scene0000_00.sens")), "scene0000_00")
    assert all(frame.labels is not None for frame in scene.frames)
