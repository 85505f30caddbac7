"""Folders of depth maps in all their file formats."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from known_scenes import write_scene
from PIL import Image

from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.depth_maps.map_folder import open_map_folder
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png

SIZE = (24, 32)
RAMP = 1 + np.arange(24 * 32, dtype=np.float32).reshape(SIZE) / 100


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return open_scene(write_scene(tmp_path / "scene", 2, SIZE).path)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "maps").mkdir()
    return tmp_path / "maps"


def write(path: Path, values: np.ndarray) -> None:
    """A map in the format that the ending says."""
    if path.suffix == ".npy":
        np.save(path, values)
    elif path.suffix == ".npz":
        np.savez_compressed(path, depth=values)
    elif path.suffix == ".png":
        write_png(path, values)
    elif path.suffix == ".tiff":
        Image.fromarray(values).save(path)
    else:
        OpenEXR = pytest.importorskip("OpenEXR")
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"Z": values}).write(str(path))


@pytest.mark.parametrize("ending", [".npy", ".npz", ".exr", ".tiff"])
def test_numbers_come_as_they_are_and_what_is_no_depth_is_unknown(scene: Scene, folder: Path, ending: str):
    values = RAMP.copy()
    values[0, :3] = np.nan, -1, 0
    write(folder / f"000{ending}", values)
    maps = open_map_folder(folder, scene, "scaled")
    found = maps.of(scene.frames[0], SIZE)
    assert found[0, :3].isnan().all()
    np.testing.assert_array_equal(found.numpy()[1:], values[1:])
    assert (maps.title, maps.meaning, maps.made_by) == (str(folder), "scaled", None)
    inverse = open_map_folder(folder, scene, "inverse").of(scene.frames[0], SIZE)
    assert inverse[0, 1:3].tolist() == [-1, 0]


def test_an_openexr_image_of_too_many_numbers_is_not_read(scene: Scene, folder: Path, monkeypatch: pytest.MonkeyPatch):
    OpenEXR = pytest.importorskip("OpenEXR")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Z": RAMP, "other": RAMP}).write(str(folder / "000.exr"))
    monkeypatch.setattr("semgs.depth_maps.map_folder.MOST_NUMBERS", 2 * RAMP.size)
    open_map_folder(folder, scene, "metric").of(scene.frames[0], SIZE)
    monkeypatch.setattr("semgs.depth_maps.map_folder.MOST_NUMBERS", 2 * RAMP.size - 1)
    with pytest.raises(InputError, match=r"at most 1,535 numbers, found 1,536"):
        open_map_folder(folder, scene, "metric").of(scene.frames[0], SIZE)


@pytest.mark.parametrize("ending", [".png", ".tiff"])
def test_counts_are_millimetres_or_in_the_stated_unit(scene: Scene, folder: Path, ending: str):
    counts = np.full(SIZE, 1500, np.uint16)
    counts[0, :2] = 0, 65535
    write(folder / f"000{ending}", counts)
    (folder / "depth.json").write_text(json.dumps({"meaning": "metric"}))
    found = open_map_folder(folder, scene, None).of(scene.frames[0], SIZE)
    assert found[0, :2].isnan().all()
    assert found[0, 2:].unique().tolist() == [pytest.approx(1.5)]
    (folder / "depth.json").write_text(json.dumps({"meaning": "metric", "unit": 0.0002, "licence": "MIT"}))
    maps = open_map_folder(folder, scene, None)
    assert maps.of(scene.frames[0], SIZE)[0, 2] == pytest.approx(0.3)
    assert maps.title == f"{folder} (licence MIT)"


def test_a_smaller_map_is_read_at_the_nearest_pixel(scene: Scene, folder: Path):
    write(folder / "000.npy", RAMP[::2, ::2])
    found = open_map_folder(folder, scene, "metric").of(scene.frames[0], (12, 16))
    np.testing.assert_array_equal(found.numpy(), RAMP[::2, ::2])


def test_a_map_of_a_wide_photo_is_cropped_or_stretched_as_the_photo_is(scene: Scene, folder: Path):
    """Of columns 0 to 31 a square of 24 keeps the middle, 4 to 27, and a stretched one takes those that its centres lie in: 0, 2, 3, 4, 6, ..., 31."""
    write(folder / "000.npy", np.tile(np.arange(32, dtype=np.float32) + 1, (24, 1)))
    maps = open_map_folder(folder, scene, "scaled")
    square = (24, 24)
    assert (maps.of(scene.frames[0], square)[0] - 1).tolist() == list(range(4, 28))
    stretched = maps.of(scene.frames[0], square, "stretch")[0] - 1
    assert stretched.tolist() == [int((column + 0.5) * 32 / 24) for column in range(24)]


def test_each_scene_may_have_a_folder_and_names_may_have_folders(scene: Scene, folder: Path):
    inner = folder / scene.name / "images"
    inner.mkdir(parents=True)
    write(inner / "001.npy", RAMP)
    (folder / "depth.json").write_text('{"meaning": "scaled"}')
    maps = open_map_folder(folder, scene, None)
    torch.testing.assert_close(maps.of(scene.frames[1], SIZE), torch.from_numpy(RAMP))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("depth.json", "{}", "meaning: missing"),
        ("depth.json", '{"meaning": "metres"}', "expected metric or scaled or inverse"),
        ("depth.json", '{"meaning": "scaled", "unit": 0.1}', "with metric maps only"),
        ("depth.json", "1", "expected an object"),
        ("000.npy", RAMP[None].repeat(3, 0), r"found \(3, 24, 32\)"),
        ("000.npy", RAMP[:12], "expected 32x24 pixels"),
        ("000.png", np.zeros(SIZE, np.uint8), "16-bit PNG"),
        ("000.exr", b"no image", "an OpenEXR image"),
        ("001.npy", RAMP, "expected a depth map of frame images/000.png"),
    ],
)  # fmt: skip
def test_what_is_no_map_is_refused_in_one_line(scene: Scene, folder: Path, name: str, content: object, message: str):
    if isinstance(content, str):
        (folder / name).write_text(content)
    elif isinstance(content, bytes):
        pytest.importorskip("OpenEXR")
        (folder / name).write_bytes(content)
    else:
        assert isinstance(content, np.ndarray)
        write(folder / name, content)
    with pytest.raises(InputError, match=message) as error:
        open_map_folder(folder, scene, None if name == "depth.json" else "metric").of(scene.frames[0], SIZE)
    assert "\n" not in str(error.value)


def test_without_a_meaning_the_error_says_how_to_give_it(scene: Scene, folder: Path):
    with pytest.raises(InputError, match="give --depth-meaning metric, scaled or inverse, or write"):
        open_map_folder(folder, scene, None)


@pytest.mark.parametrize("meaning", ["metric", "scaled"])
def test_the_background_of_renderers_is_unknown(scene: Scene, folder: Path, meaning: str):
    values = RAMP.copy()
    values[0, :2] = 1e10, 65504
    np.save(folder / "000.npy", values)
    found = open_map_folder(folder, scene, meaning).of(scene.frames[0], SIZE)
    assert found[0, :2].isnan().all()
    assert found[0, 2:].isfinite().all()


LAYERS = ("ViewLayer.Combined.R", "ViewLayer.Combined.G", "ViewLayer.Combined.B")


def write_layers(path: Path, *names: str) -> None:
    """An OpenEXR image whose colours are 0, and each of the other channels the ramp plus its number."""
    OpenEXR = pytest.importorskip("OpenEXR")
    channels = {name: np.zeros(SIZE, np.float32) for name in LAYERS} | {name: RAMP + k for k, name in enumerate(names)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))


@pytest.mark.parametrize("name", ["ViewLayer.Depth.Z", "View Layer.Depth.Z", "ViewLayer.Depth.V", "RenderLayer.Z"])
def test_depth_among_the_layers_of_an_exr_is_found(scene: Scene, folder: Path, name: str):
    write_layers(folder / "000.exr", name)
    found = open_map_folder(folder, scene, "metric").of(scene.frames[0], SIZE)
    np.testing.assert_array_equal(found.numpy(), RAMP)


@pytest.mark.parametrize("names", [(), ("A.Depth.Z", "B.Depth.Z")])
def test_an_exr_without_one_channel_of_depth_lists_its_channels_once(
    scene: Scene, folder: Path, names: tuple[str, ...]
):
    write_layers(folder / "000.exr", *names)
    with pytest.raises(
        InputError, match=r"expected a channel Z, Y, R, or one that ends in .Z or .Depth.V, found"
    ) as told:
        open_map_folder(folder, scene, "metric").of(scene.frames[0], SIZE)
    assert str(told.value).count("expected") == 1
