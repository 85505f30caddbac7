"""Maps of photos: their files, and their values at the pixels of views."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np
import pytest
import torch
from PIL import Image

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.files.errors import InputError
from semgs.sources.photo_maps import needed_file, normalised, one_hot, resized_map, to_view

POSE = np.array([[0, -1, 0, 0.3], [1, 0, 0, 0.1], [0, 0, 1, -0.2], [0, 0, 0, 1]], dtype=np.float64)
SIZE = (90, 121)
"""An odd size; a photo lens off the middle."""


def photo(folder, distortion=(0.0, 0.0, 0.0, 0.0, 0.0)) -> tuple[Frame, np.ndarray]:
    """A frame whose red is the probability of class 0, and the map of that: smooth, different at each pixel."""
    y, x = np.mgrid[: SIZE[0], : SIZE[1]]
    red = np.rint(40 + 1.1 * x + 0.8 * y).astype(np.uint8)
    Image.fromarray(np.stack((red, 0 * red, 0 * red), -1)).save(folder / "photo.png")
    frame = Frame("photo.png", folder / "photo.png", Lens(SIZE, (88.0, 91.0), (57.3, 47.1), distortion), POSE)
    share = red.astype(np.float32) / 255
    return frame, np.stack((share, 1 - share))


@pytest.mark.parametrize("distortion", [(0.0,) * 5, (-0.11, 0.02, 0.003, -0.002, 0.0)])
@pytest.mark.parametrize("size", [SIZE, (45, 60), (48, 48), (64, 144), (100, 131)])
@pytest.mark.parametrize("fit", ["crop", "stretch"])
def test_a_map_that_tells_position_lands_where_the_photo_does(tmp_path, distortion, size, fit):
    """Red is a position of the stored photo, and the map says red: after lens, crop or stretching, and resizing both say the same at each pixel."""
    frame, stored = photo(tmp_path, distortion)
    view = frame.view((0.1, 10.0), size=size, fit=fit)
    found = to_view(stored, frame, size, fit, undistorted=False)
    assert found.shape == (2, *size)
    # The photo was rounded to 8 bits after undistortion, the map was not.
    torch.testing.assert_close(found[0], view.images[0, 0], rtol=0, atol=0.51 / 255 if any(distortion) else 1e-6)
    torch.testing.assert_close(found.sum(0), torch.ones(size))


def test_a_map_of_the_undistorted_photo_is_not_undistorted_again(tmp_path):
    frame, _ = photo(tmp_path, (-0.11, 0.02, 0.003, -0.002, 0.0))
    red = frame.read_undistorted()[..., 0].astype(np.float32) / 255
    found = to_view(np.stack((red, 1 - red)), frame, (45, 60), undistorted=True)
    expected = frame.view((0.1, 10.0), size=(45, 60), fit="crop").images[0, 0]
    torch.testing.assert_close(found[0], expected, rtol=0, atol=1e-6)


def test_small_maps_are_interpolated_and_large_ones_averaged():
    """Two texels over four pixels: their centres are at 1 and 3, so pixels at .5, 1.5, 2.5, 3.5 get 0, 1/4, 3/4, 1. Back: the means of pairs."""
    small = torch.tensor([[[1.0, 0.0]], [[0.0, 1.0]]]).double()
    wide = resized_map(small, (2, 4), (2, 4))
    assert wide[0].tolist() == [[1.0, 0.75, 0.25, 0.0]] * 2
    back = resized_map(wide, (2, 4), (1, 2))
    assert back[0].tolist() == [[0.875, 0.125]]


def test_a_crop_takes_the_middle_and_halves_are_normalised():
    """Of six columns to an aspect of 1:2 the middle four remain of two rows; each pixel's (1/2, 1/4) becomes (2/3, 1/3)."""
    columns = torch.arange(6.0).expand(2, 6)
    found = resized_map(torch.stack((columns, 6 - columns)), (2, 6), (2, 4))
    assert (found[0, 0] * 6).tolist() == [1, 2, 3, 4]
    torch.testing.assert_close(normalised(torch.tensor([[[0.5]], [[0.25]]])).flatten(), torch.tensor([2 / 3, 1 / 3]))


def test_a_pixel_without_label_is_even():
    found = one_hot(torch.tensor([[2, 255]], dtype=torch.uint8), 4)
    assert found[:, 0, 0].tolist() == [0, 0, 1, 0]
    assert found[:, 0, 1].tolist() == [0.25] * 4


@pytest.mark.parametrize(
    ("endings", "wanted"),
    [
        ((".png", ".npz"), "a map of frame photo.png: photo.png or photo.npz, found none"),
        ((".npy", ".exr", ".tiff"), "a map of frame photo.png: photo with one of .npy, .exr, .tiff, found none"),
    ],
)
def test_a_missing_file_is_named_with_the_endings_that_it_may_have(tmp_path, endings, wanted):
    frame, _ = photo(tmp_path)
    folder = tmp_path / "maps"
    folder.mkdir()
    with pytest.raises(InputError, match=re.escape(wanted)):
        needed_file(folder, frame, Counter(photo=1), endings, "a map")
    (folder / f"photo{endings[1]}").touch()
    assert needed_file(folder, frame, Counter(photo=1), endings, "a map") == folder / f"photo{endings[1]}"
