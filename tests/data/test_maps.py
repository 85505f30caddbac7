"""What frames are made of: sources that read themselves, for the pixels that a frame is read at."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from posed import posed_cameras

import semgs.data
from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.maps import DepthMap, DepthThroughLens, InMemory, MapSource, MaskMap, Pixels
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError

LENS = Lens((4, 6), (5.0, 5.5), (2.8, 1.9))
RANGE = (0.5, 10.0)
NUMBERS = np.arange(24, dtype=np.float32).reshape(4, 6)


def frame(folder: Path, lens: Lens = LENS, **parts: MapSource) -> Frame:
    """A grey picture with these parts."""
    cv2.imwrite(str(folder / "grey.png"), np.full((*lens.size, 3), 128, np.uint8))
    return Frame("grey", folder / "grey.png", lens, np.eye(4), **parts)


def pixels(lens: Lens = LENS) -> Pixels:
    """Those of a picture as it is stored."""
    return Pixels(lens, Frame("", Path("nowhere"), lens, np.eye(4)).camera)


def test_a_map_is_cropped_and_resized_as_the_picture_is(tmp_path):
    """Of 4x6, a square is the middle four columns; halved, each pixel takes the old one at its centre: the second of two."""
    view = frame(tmp_path, depth=InMemory(NUMBERS)).view(RANGE, size=(2, 2), fit="crop")
    assert view.depths[0].tolist() == [[8, 10], [20, 22]]
    stretched = frame(tmp_path, depth=InMemory(NUMBERS)).view(RANGE, size=(2, 3))
    assert stretched.depths[0].tolist() == [[7, 9, 11], [19, 21, 23]]


def test_maps_in_memory_may_run_backwards(tmp_path):
    """Upside down, of the middle columns 1 to 4, the second of each two rows and columns: rows 2 and 0, columns 2 and 4."""
    labels = np.arange(24, dtype=np.uint8).reshape(4, 6) % 20
    backwards = frame(tmp_path, depth=InMemory(NUMBERS[::-1]), labels=InMemory(labels[:, ::-1]))
    view = backwards.view(RANGE, SCANNET20)
    assert view.depths[0].tolist() == NUMBERS[::-1].tolist()
    assert view.labels[0].tolist() == labels[:, ::-1].tolist()
    assert backwards.view(RANGE, size=(2, 2), fit="crop").depths[0].tolist() == [[14, 16], [2, 4]]


def test_a_mask_hides_depth_and_labels_of_any_source(tmp_path):
    """127 hides, 128 does not: of two rows the first is hidden."""
    mask = np.repeat(np.array([[127], [127], [128], [255]], np.uint8), 6, axis=1)
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    labels = InMemory(np.full((4, 6), 3, np.uint8))
    masked = frame(tmp_path, depth=InMemory(NUMBERS + 1), labels=labels, mask=MaskMap(tmp_path / "mask.png"))
    view = masked.view(RANGE, SCANNET20)
    assert view.depths[0, 1:3].tolist() == [[0] * 6, [13, 14, 15, 16, 17, 18]]
    assert view.labels[0, :, 0].tolist() == [255, 255, 3, 3]
    assert masked.measured()[0, 5] == 6  # what was measured is not changed by what may be looked at


def test_the_bits_of_rotated_counts_are_turned_back(tmp_path):
    """1500 mm turned left by three bits is 8 x 1500; the three lowest bits that are stored are the three highest of 57344 = 7 x 2^13."""
    cv2.imwrite(str(tmp_path / "d.png"), np.array([[8 * 1500, 0b111], [0, 0]], np.uint16))
    metres = DepthMap(tmp_path / "d.png", rotated=True).metres()
    np.testing.assert_allclose(metres, [[1.5, 57.344], [0, 0]], rtol=1e-6)


def test_depth_of_another_lens_is_what_each_ray_meets(tmp_path):
    """With twice the focal length about the same middle, the middle half is spread over all, and the outside is unseen the other way."""
    near, far = Lens((4, 4), (8.0, 8.0), (2.0, 2.0)), Lens((4, 4), (4.0, 4.0), (2.0, 2.0))
    cv2.imwrite(str(tmp_path / "d.png"), (1000 + np.arange(16, dtype=np.uint16)).reshape(4, 4))
    source = DepthThroughLens(DepthMap(tmp_path / "d.png"), far)
    wide = source.read(pixels(near))
    assert np.rint(1000 * wide[0]).tolist() == [1005, 1005, 1006, 1006]
    narrow = DepthThroughLens(DepthMap(tmp_path / "d.png"), near).read(pixels(far))
    assert np.count_nonzero(narrow) == 4  # the middle 2x2 sees it
    assert not narrow[0].any()


def test_a_map_of_another_size_than_its_picture_is_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "d.png"), np.ones((4, 5), np.uint16))
    with pytest.raises(InputError, match=r"6x4 pixels .*, the size of its image, found 5x4"):
        frame(tmp_path, depth=DepthMap(tmp_path / "d.png")).view(RANGE)
    with pytest.raises(ValueError, match=r"the map is \(2, 3\) .* expected \(4, 6\)"):
        frame(tmp_path, depth=InMemory(np.ones((2, 3), np.float32))).view(RANGE)


def test_a_class_of_the_data_package_is_abstract_or_nobody_derives_from_it():
    """And so nothing concrete is replaced but what an abstract class left open."""
    classes = set()
    for module in pkgutil.walk_packages(semgs.data.__path__, "semgs.data."):
        members = inspect.getmembers(importlib.import_module(module.name), inspect.isclass)
        classes |= {one for _, one in members if one.__module__.startswith("semgs.")}
    assert Frame in classes
    derived = {base for one in classes for base in one.__mro__[1:] if base in classes}
    assert {base.__name__ for base in derived if not inspect.isabstract(base)} == set()
    for one in classes:
        for base in one.__mro__[1:]:
            if base in derived:
                replaced = {name for name in vars(one).keys() & vars(base).keys() if not name.startswith("__")}
                open_ones = base.__abstractmethods__ | {"_abc_impl"}
                assert replaced <= open_ones, (one, base, replaced - open_ones)


def test_maps_are_stretched_unless_a_crop_is_asked_for():
    """6 columns at 3: columns 1, 3 and 5 if stretched; 3 of the 4 middle ones if cropped."""
    camera = posed_cameras(1, (4, 3))[0]
    stretched = Pixels(LENS, camera).taken(NUMBERS)
    assert stretched.shape == (4, 3)
    assert stretched[0, 0] <= 1
    assert stretched[0, 2] >= 4


@pytest.mark.parametrize(("dtype", "background"), [(np.float32, 1e10), (np.float16, 65504), (np.float64, np.inf), (np.int32, 2**31 - 1)])  # fmt: skip
def test_the_background_of_renderers_is_no_measurement(tmp_path: Path, dtype: type, background: float):
    """Blender writes 1e10, half floats end at 65504, and integers at their largest number."""
    np.save(tmp_path / "a.npy", np.array([[2, background], [0, 5]], dtype))
    np.testing.assert_array_equal(DepthMap(tmp_path / "a.npy", 1.0).metres(), np.array([[2, 0], [0, 5]], np.float32))


@pytest.mark.parametrize("shape", [(2, 3, 1), (1, 2, 3)])
def test_depths_and_confidences_may_have_one_channel(tmp_path: Path, shape: tuple[int, ...]):
    np.save(tmp_path / "a.npy", np.array([[2, 3, 4], [0, 5, 6]], np.float32).reshape(shape))
    np.save(tmp_path / "c.npy", np.array([[1, 0, 2], [1, 1, 1]], np.uint8).reshape(shape))
    found = DepthMap(tmp_path / "a.npy", 1.0, confidence=tmp_path / "c.npy").metres()
    np.testing.assert_array_equal(found, np.array([[2, 0, 4], [0, 5, 6]], np.float32))
