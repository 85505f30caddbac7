"""Label maps and masks as programs and optimisers store them: the numbers that were meant come out."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgs.data.maps import read_labels
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_numbers, read_uint16, read_visible, write_png

NUMBERS = np.array([[0, 1, 3], [3, 2, 0]], np.uint8)
WALL, FLOOR, CABINET, BED = SCANNET20.colours[:4]
TWO = ClassTable("two", ("seat", "lamp"), ((200, 10, 10), (10, 200, 10)), (5, 7))
TWO_OF_NUMBERS = tuple({5: 0, 6: 0, 7: 1, 255: 255}.get(number) for number in range(256))


def palette_png(path: Path, indices: np.ndarray, palette: list[tuple[int, int, int]]) -> Path:
    """A PNG of indices [h w] with a palette."""
    image = Image.frombytes("P", indices.shape[::-1], indices.astype(np.uint8).tobytes())
    image.putpalette(np.array(palette, np.uint8).tobytes())
    image.save(path)
    return path


def packed_png(path: Path, numbers: np.ndarray, bits: int) -> Path:
    """A grey PNG of so many bits a pixel, its rows padded to bytes. https://www.w3.org/TR/png-3/#7Scanline"""
    digits = np.unpackbits(numbers[..., None].astype(np.uint8), axis=-1)[..., -bits:].reshape(len(numbers), -1)
    rows = b"".join(b"\0" + row.tobytes() for row in np.packbits(digits, axis=1))
    header = struct.pack(">2I5B", *numbers.shape[::-1], bits, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    body = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    ]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(body))
    return path


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
def test_numbers_are_the_same_in_every_bit_depth(tmp_path: Path, bits: int):
    numbers = NUMBERS & ((1 << bits) - 1)
    np.testing.assert_array_equal(read_numbers(packed_png(tmp_path / "a.png", numbers, bits)), numbers)


def test_greys_of_a_palette_are_the_numbers(tmp_path: Path):
    path = palette_png(tmp_path / "a.png", NUMBERS, [(9, 9, 9), (3, 3, 3), (0, 0, 0), (12, 12, 12)])
    np.testing.assert_array_equal(read_labels(path, SCANNET20), [[9, 3, 12], [12, 0, 9]])


@pytest.mark.parametrize("alpha", [False, True])
def test_equal_channels_are_one(tmp_path: Path, alpha: bool):
    pixels = np.repeat(NUMBERS[..., None], 3, -1)
    write_png(tmp_path / "a.png", np.dstack((pixels, np.full_like(NUMBERS, 255))) if alpha else pixels)
    np.testing.assert_array_equal(read_labels(tmp_path / "a.png", SCANNET20), NUMBERS)


def test_sixteen_bits_may_hold_labels(tmp_path: Path):
    write_png(tmp_path / "a.png", np.array([[3, 255]], np.uint16))
    np.testing.assert_array_equal(read_labels(tmp_path / "a.png", SCANNET20), [[3, 255]])
    write_png(tmp_path / "a.png", np.array([[3, 259, 259]], np.uint16))
    with pytest.raises(InputError, match="found 259 at 2 pixels"):
        read_labels(tmp_path / "a.png", SCANNET20)


def test_a_palette_of_the_class_tables_colours_says_the_classes(tmp_path: Path):
    """An optimiser sorted them: bed, black, wall, floor; black is no class."""
    path = palette_png(tmp_path / "a.png", NUMBERS, [BED, (0, 0, 0), WALL, FLOOR])
    np.testing.assert_array_equal(read_labels(path, SCANNET20), [[3, 255, 1], [1, 0, 3]])


def test_a_palette_of_the_colours_of_a_class_file_says_the_classes(tmp_path: Path):
    """Its numbers are 5 and 6 for a seat, 7 for a lamp."""
    path = palette_png(tmp_path / "a.png", NUMBERS % 2, [TWO.colours[1], TWO.colours[0]])
    np.testing.assert_array_equal(read_labels(path, TWO, meaning=TWO_OF_NUMBERS), [[1, 0, 0], [0, 1, 1]])


def test_an_unknown_palette_gives_its_indices_unless_an_optimiser_may_have_renumbered_it(tmp_path: Path):
    """Optimisers drop colours that no pixel has: the fifth shows that none was at work."""
    colours = [(1, 2, 3), (200, 2, 3), (1, 200, 3), (9, 9, 200)]
    path = palette_png(tmp_path / "a.png", NUMBERS, [*colours, (77, 8, 9)])
    np.testing.assert_array_equal(read_labels(path, SCANNET20), NUMBERS)
    with pytest.raises(InputError, match="a palette of other colours; an image optimiser may have renumbered it"):
        read_labels(palette_png(tmp_path / "a.png", NUMBERS, colours), SCANNET20)


def test_an_index_beyond_the_palette_is_damage(tmp_path: Path):
    path = palette_png(tmp_path / "a.png", NUMBERS, [(9, 9, 9), (3, 3, 3), (0, 0, 0), (12, 12, 12)])
    data = path.read_bytes()
    at = data.index(b"PLTE") - 4
    short = b"PLTE" + data[at + 8 : at + 14]
    path.write_bytes(data[:at] + struct.pack(">I", 6) + short + struct.pack(">I", zlib.crc32(short)) + data[at + 24 :])
    with pytest.raises(InputError, match="palette of 4 colours or more, found 2"):
        read_numbers(path)


SHOWN = np.array([[False, True, True], [True, True, False]])


@pytest.mark.parametrize(("low", "high"), [(0, 1), (0, 2), (0, 255), (127, 128)])
def test_masks_show_their_higher_number(tmp_path: Path, low: int, high: int):
    write_png(tmp_path / "a.png", np.where(SHOWN, high, low).astype(np.uint8))
    np.testing.assert_array_equal(read_visible(tmp_path / "a.png"), SHOWN)


@pytest.mark.parametrize("bits", [1, 2, 4])
def test_masks_of_few_bits_show_their_higher_number(tmp_path: Path, bits: int):
    for high in {1, (1 << bits) - 1}:
        np.testing.assert_array_equal(read_visible(packed_png(tmp_path / "a.png", SHOWN * high, bits)), SHOWN)


def test_masks_of_sixteen_bits_colours_and_palettes_show_what_is_bright(tmp_path: Path):
    write_png(tmp_path / "16.png", np.where(SHOWN, 65535, 0).astype(np.uint16))
    write_png(tmp_path / "rgb.png", np.repeat(np.where(SHOWN, 255, 0).astype(np.uint8)[..., None], 3, -1))
    palette_png(tmp_path / "palette.png", ~SHOWN, [(255, 255, 255), (0, 0, 0)])
    for name in ("16", "rgb", "palette"):
        np.testing.assert_array_equal(read_visible(tmp_path / f"{name}.png"), SHOWN, name)


def test_noise_in_a_dark_mask_is_still_dark(tmp_path: Path):
    write_png(tmp_path / "a.png", np.array([[0, 1, 2], [5, 0, 3]], np.uint8))
    assert not read_visible(tmp_path / "a.png").any()


def test_depth_of_few_bits_is_still_refused(tmp_path: Path):
    with pytest.raises(InputError, match="16-bit PNG of one channel, found a PNG of one channel with 8 bits"):
        read_uint16(packed_png(tmp_path / "a.png", NUMBERS, 4))
