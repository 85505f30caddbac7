import numpy as np
import pytest

from semgs.files.errors import InputError
from semgs.files.images.colours import LINEAR
from semgs_rooms.assets.asset_images import decode, fill_gaps, pack, pyramid


def levels(size):
    width, height = size
    while True:
        yield width, height
        if width == height == 1:
            return
        width, height = max(1, width // 2), max(1, height // 2)


def test_a_pyramid_ends_in_the_mean_of_the_picture_in_linear_light():
    picture = np.random.default_rng(0).integers(0, 256, (16, 64, 3), dtype=np.uint8)
    result = pyramid(picture)
    assert result.size == (64, 16)
    np.testing.assert_array_equal(result.pixels[: 64 * 16].reshape(16, 64, 3), picture)
    assert len(result.pixels) == sum(w * h for w, h in levels((64, 16)))
    mean = LINEAR[picture].mean(axis=(0, 1))
    np.testing.assert_allclose(LINEAR[result.pixels[-1]], mean, atol=0.02)


def test_black_and_white_stripes_are_188_from_afar():
    """Half the light of white is sRGB 188, not 128."""
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:, ::2] = 255
    assert abs(int(pyramid(picture).pixels[-1, 0]) - 188) <= 1


def test_a_pack_finds_each_picture_again():
    rng = np.random.default_rng(1)
    pictures = [rng.integers(0, 256, (h, w, 3), dtype=np.uint8) for h, w in ((5, 9), (1, 1), (12, 7))]
    packed = pack([pyramid(picture) for picture in pictures])
    for picture, (start, width, height, count) in zip(pictures, packed.table, strict=True):
        assert (height, width) == picture.shape[:2]
        assert count == len(list(levels((width, height))))
        np.testing.assert_array_equal(packed.pixels[start : start + width * height], picture.reshape(-1, 3))
    assert pack([]).table.shape == (0, 4)


def test_what_no_triangle_covers_takes_the_colours_beside_it():
    picture = np.zeros((12, 20, 3), np.uint8)
    picture[:, :8] = (200, 100, 50)
    used = np.zeros((12, 20), np.float32)
    used[:, :8] = 1
    filled = fill_gaps(picture, used)
    np.testing.assert_array_equal(filled[:, :8], picture[:, :8])
    assert np.abs(filled[:, 8:].astype(int) - (200, 100, 50)).max() <= 2


def test_bytes_that_are_no_picture_are_refused_by_name(tmp_path):
    for raw in (b"", b"not a picture"):
        with pytest.raises(InputError, match=r"wood\.jpg"):
            decode(raw, tmp_path / "wood.jpg")
