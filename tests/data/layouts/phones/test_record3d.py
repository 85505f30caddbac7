"""Record3D's recordings: quaternions, axes and pixels, depth in LZFSE, and what is said of damaged ones."""

from __future__ import annotations

import json
import pickle
import resource
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("lzfse")

import lzfse
from miniatures import Miniature, check_projection, check_read, miniature
from phone_captures import as_jpegs, record3d_metadata, write_record3d, zipped

from semgs.cli.main import main
from semgs.data.layouts.phones import record3d
from semgs.data.layouts.phones.record3d import LzfseFile, _inflated
from semgs.data.scenes import open_scene, open_scenes
from semgs.files.errors import InputError

K = (52.0, 50.0, 25.0, 30.5)


def upright(frames: int = 8) -> Miniature:
    """The room as phones are held, 48x64 (width x height)."""
    return miniature((64, 48), frames)


@pytest.mark.parametrize("inside", [None, "", "2026-11-24--10-00-00/"])
def test_what_is_read_equals_what_was_written(tmp_path: Path, inside: str | None):
    room = write_record3d(tmp_path / "my room", upright())
    path = tmp_path / "my room" if inside is None else zipped(tmp_path / "my room", tmp_path / "my room.r3d", inside)
    scene = open_scene(path)
    check_read(pickle.loads(pickle.dumps(scene)), room)
    assert (scene.layout, scene.unit, scene.name, scene.notes) == ("Record3D", "metric", "my room", ())


def test_archives_in_a_folder_are_its_scenes(tmp_path: Path):
    for name in ("b", "a"):
        write_record3d(tmp_path / name, upright(2))
        zipped(tmp_path / name, tmp_path / f"{name}.r3d")
        shutil.rmtree(tmp_path / name)
    assert [scene.name for scene in open_scenes(tmp_path)] == ["a", "b"]


def test_a_point_is_where_the_quaternion_and_the_columns_of_k_put_it(tmp_path: Path):
    """A camera at (1, 2, 3), turned by 90 degrees about y, looks along -x: 2 m ahead, 1 m up and half a metre to the right is (-1, 3, 2.5)."""
    poses = [[0, 0.5**0.5, 0, 0.5**0.5, 1, 2, 3]] * 3
    write_record3d(tmp_path, upright(3), K, poses=poses)
    # u = 25 + 52 * 0.5 / 2 = 38 and v = 30.5 - 50 * 1 / 2 = 5.5 from the corner of the first pixel
    check_projection(open_scene(tmp_path), 2, np.array((-1, 3, 2.5)), (5.0, 37.5), 2.0)


def test_intrinsics_of_each_frame_come_before_those_of_the_first(tmp_path: Path):
    each = [[52.0 + index, 50.0, 25.0, 30.0 - index] for index in range(8)]
    write_record3d(tmp_path, upright(), K, perFrameIntrinsicCoeffs=each)
    lenses = [frame.lens for frame in open_scene(tmp_path).frames]
    assert (lenses[5].focal, lenses[5].centre) == ((57.0, 50.0), (25.0, 25.0))
    assert open_scene(tmp_path, intrinsics=(50.0, 51.0, 20.0, 30.0)).frames[5].lens.focal == (50.0, 51.0)


def test_images_of_twice_the_stated_size_have_twice_the_intrinsics(tmp_path: Path):
    write_record3d(tmp_path, upright(2), (26.0, 25.0, 12.5, 15.25), w=24, h=32)
    lens = open_scene(tmp_path).frames[0].lens
    assert (lens.size, lens.focal, lens.centre) == ((64, 48), (52.0, 50.0), (25.0, 30.5))


def test_frames_are_in_the_order_of_their_numbers_and_poses_go_by_number(tmp_path: Path):
    room = write_record3d(tmp_path, upright())
    (tmp_path / "rgbd/3.jpg").unlink()
    for old, new in ((7, 10), (6, 9)):  # beyond the list of poses
        (tmp_path / f"rgbd/{old}.jpg").rename(tmp_path / f"rgbd/{new}.jpg")
    scene = open_scene(tmp_path)
    check_read(scene, room, [0, 1, 2, 4, 5])
    assert scene.notes == ("2 of 7 frames have no pose and are left out, the first is rgbd/9.jpg.",)


def test_depth_of_low_confidence_is_unknown(tmp_path: Path):
    room = write_record3d(tmp_path, upright())
    confidence = np.ones(room.size, np.uint8)
    confidence[30:, 20:] = 0
    (tmp_path / "rgbd/4.conf").write_bytes(lzfse.compress(confidence.tobytes()))
    depths = open_scene(tmp_path).read([4], "native").depths[0].numpy()
    np.testing.assert_allclose(depths, np.where(confidence == 0, 0, room.depths[4] / 1000), atol=1e-6)


def test_depth_of_a_smaller_map_is_that_of_the_nearest_pixel_and_nan_is_unknown(tmp_path: Path):
    room = write_record3d(tmp_path, upright(), dw=12, dh=16)
    small = (room.depths[:, 2::4, 1::4] / 1000).astype("<f4")
    small[:, 7, 5] = np.nan
    for index, depths in enumerate(small):
        (tmp_path / f"rgbd/{index}.depth").write_bytes(lzfse.compress(depths.tobytes()))
        (tmp_path / f"rgbd/{index}.conf").unlink()
    read = open_scene(tmp_path).read([3], "native").depths[0].numpy()
    np.testing.assert_allclose(read, np.nan_to_num(small[3]).repeat(4, 0).repeat(4, 1), atol=1e-6)
    assert (read[28:32, 20:24] == 0).all()


def test_exr_and_jpg_files_are_read_without_their_depth(tmp_path: Path):
    files, room = as_jpegs(upright())
    for name in ("rgb", "depth"):
        (tmp_path / "kitchen/EXR_RGBD" / name).mkdir(parents=True)
    folder = tmp_path / "kitchen/EXR_RGBD"
    for index, file in enumerate(files):
        (folder / f"rgb/{index}.jpg").write_bytes(file)
        (folder / f"depth/{index}.exr").touch()
    (folder / "metadata.json").write_text(record3d_metadata(room, K))
    scene = open_scene(folder)
    assert scene.name == "kitchen_EXR_RGBD"
    check_read(scene, room, depths=False)
    assert scene.notes == ("8 depth maps are left out because EXR is not read; share the recording as .r3d.",)
    assert scene.frames[0].depth is None
    with pytest.raises(InputError, match=r"there is one in .*EXR_RGBD"):
        open_scene(tmp_path / "kitchen")


def test_without_lzfse_depth_is_left_out_and_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    room = write_record3d(tmp_path, upright())
    monkeypatch.setattr(record3d, "can_inflate", lambda: False)
    scene = open_scene(tmp_path)
    check_read(scene, room, depths=False)
    assert scene.frames[0].depth is None
    assert scene.notes == ("8 depth maps are left out because lzfse is not installed (pip install -e '.[phone]').",)


def test_noise_that_lzfse_cannot_compress_is_read(tmp_path: Path):
    write_record3d(tmp_path, upright(3))
    noise = np.random.default_rng(0).uniform(0.5, 5, (64, 48)).astype("<f4")
    (tmp_path / "rgbd/1.depth").write_bytes(lzfse.compress(noise.tobytes()))
    np.testing.assert_array_equal(open_scene(tmp_path).read([1], "native").depths[0].numpy(), noise)


def test_a_map_of_a_stated_size_that_nobody_has_is_refused_before_memory_is_taken(tmp_path: Path):
    (tmp_path / "a").write_bytes(lzfse.compress(bytes(3072)))
    with pytest.raises(OSError, match=r"a map of 100000x90000; at most 67,108,864 pixels are read"):
        LzfseFile(tmp_path / "a", (90_000, 100_000)).read_bytes()


@pytest.mark.parametrize("kept", range(1, 54, 4))
def test_a_map_that_is_cut_off_is_refused_and_takes_no_memory(tmp_path: Path, kept: int):
    # lzfse's own function doubles its buffer without end for such a file.
    packed = lzfse.compress(bytes([2]) * 3072)
    assert packed.startswith(b"bvxn")
    (tmp_path / "a").write_bytes(packed[:kept])
    limits = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + (1 << 28), limits[1]))
    try:
        with pytest.raises(OSError, match=r"damaged|not a map of 64x48"):
            LzfseFile(tmp_path / "a", (48, 64), "u1").read_bytes()
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "damaged: it is not LZFSE"),
        (b"bvx2" + bytes(60), "damaged: it is not LZFSE"),
        (lzfse.compress(bytes(4000)), r"not a map of 48x64 \(width x height\), which has 12288 bytes"),
        (lzfse.compress(bytes(12288)) + bytes(12288), r"not a map of 48x64 \(width x height\), which has 12288 bytes"),
    ],
)
def test_damaged_depth_is_refused_with_its_member(tmp_path: Path, data: bytes, message: str):
    write_record3d(tmp_path / "a", upright(3))
    (tmp_path / "a/rgbd/1.depth").write_bytes(data)
    scene = open_scene(zipped(tmp_path / "a", tmp_path / "a.r3d"))
    with pytest.raises(InputError, match=rf"a\.r3d/rgbd/1\.depth: .*{message}"):
        scene.read([0, 1])


def test_metadata_without_the_size_are_those_of_the_images(tmp_path: Path):
    write_record3d(tmp_path, upright(3), w=None, h=None)
    lens = open_scene(tmp_path).frames[1].lens
    assert (lens.focal, lens.centre) == ((52.0, 50.0), (25.0, 30.5))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"poses": []}, "poses: expected the poses of the frames, found none; record with the LiDAR camera"),
        ({"poses": [[0, 0, 0, 1, 0, 0]] * 3}, "poses: expected rows of 7 numbers"),
        ({"poses": [[0, 0, 0, 1, 0, 0, 0], "x"]}, "poses: expected rows of 7 numbers"),
        ({"poses": [[0, 0, 0, 2, 0, 0, 0]] * 3}, r"poses\[0\]: expected a unit quaternion"),
        (
            {"poses": [[0, 0, 0, 0, 0, 0, 0]] * 3},
            "at least two usable frames, found 0; 3 of 3 frames have no finite pose",
        ),
        ({"K": [1, 2, 3]}, "K: expected rows of 9 numbers"),
        ({"K": []}, "K: expected a camera matrix"),
        ({"K": [-52, 0, 0, 0, 50, 0, 25, 30, 1]}, "expected a possible camera"),
        ({"w": 24}, "expected intrinsics for 48x64 pixels"),
        ({"perFrameIntrinsicCoeffs": {"a": 1}}, "perFrameIntrinsicCoeffs: expected rows of 4 numbers"),
    ],
)
def test_damaged_metadata_are_refused_in_one_line(tmp_path: Path, values: dict, message: str, capsys):
    write_record3d(tmp_path, upright(3), **values)
    with pytest.raises(InputError, match=message):
        open_scene(tmp_path)
    assert main(["reconstruct", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_what_only_looks_like_a_recording_is_not_taken_for_one(tmp_path: Path):
    (tmp_path / "rgb").mkdir()
    cv2.imwrite(str(tmp_path / "rgb/0.jpg"), np.zeros((4, 6, 3), np.uint8))
    (tmp_path / "metadata.json").write_text(json.dumps({"author": "somebody"}))
    with pytest.raises(InputError, match="no known layout; images alone have no poses"):
        open_scene(tmp_path)
    (tmp_path / "a.r3d").write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"a\.r3d: expected a zip archive"):
        open_scene(tmp_path / "a.r3d")


def test_a_build_of_lzfse_that_hides_its_function_is_used_with_complete_data_only(monkeypatch: pytest.MonkeyPatch):
    data = lzfse.compress(bytes(range(100)))

    def hidden(name: str) -> None:
        raise OSError(name)

    monkeypatch.setattr("semgs.data.layouts.phones.record3d.ctypes.CDLL", hidden)
    assert _inflated(data, 1000) == bytes(range(100))
    assert _inflated(data, 40) == bytes(range(40))
    assert _inflated(data[:-4], 1000) == b""
