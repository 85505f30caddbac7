"""Pictures: what a file means, and what is refused."""

from __future__ import annotations

import contextlib
import io
import struct
import sys
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageOps
from traced_memory import most_memory

from semgs.files.errors import InputError
from semgs.files.images.pictures import (
    PictureHeader,
    _check_scans,
    decode_png,
    decode_rgb,
    is_float_tiff,
    png_bytes,
    read_grey,
    read_header,
    read_optics,
    read_rgb,
    read_tiff,
    read_uint8,
    read_uint16,
    read_upright,
    write_png,
    write_tiff,
)

HEIGHT, WIDTH = 24, 37


@pytest.fixture
def rgb() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)


def smooth(height: int = 200, width: int = 310) -> np.ndarray:
    """A picture that JPEG keeps well: one colour per corner."""
    corners = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 0]]], dtype=np.uint8)
    return cv2.resize(corners, (width, height), interpolation=cv2.INTER_LINEAR)


def oriented(path: Path, pixels: np.ndarray, orientation: int) -> Path:
    """A PNG with an EXIF orientation."""
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(pixels).save(path, exif=exif)
    return path


@pytest.mark.parametrize(
    ("shape", "dtype"), [((HEIGHT, WIDTH, 3), np.uint8), ((HEIGHT, WIDTH), np.uint8), ((HEIGHT, WIDTH), np.uint16)]
)
def test_what_is_written_is_read_back_bit_by_bit(tmp_path, shape, dtype):
    array = np.random.default_rng(1).integers(0, np.iinfo(dtype).max, shape, dtype=dtype, endpoint=True)
    write_png(tmp_path / "a.png", array)
    read = read_uint16 if dtype == np.uint16 else read_rgb if len(shape) == 3 else read_uint8
    again = read(tmp_path / "a.png")
    assert again.dtype == dtype
    np.testing.assert_array_equal(again, array)
    assert [one.name for one in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize(
    "array",
    [
        np.zeros((4, 5), np.float32),
        np.zeros((4, 5, 2), np.uint8),
        np.zeros((4, 5, 3), np.uint16),
        np.zeros((0, 5), np.uint8),
    ],
)
def test_arrays_that_are_no_picture_are_not_written(tmp_path, array):
    with pytest.raises(ValueError, match="expected uint8"):
        write_png(tmp_path / "a.png", array)
    assert not list(tmp_path.iterdir())


def test_a_jpeg_comes_out_as_it_was_drawn(tmp_path):
    Image.fromarray(smooth()).save(tmp_path / "a.jpg", quality=95)
    assert np.abs(read_rgb(tmp_path / "a.jpg").astype(int) - smooth()).max() <= 6


def test_grey_pictures_have_three_equal_channels(tmp_path, rgb):
    Image.fromarray(rgb[..., 0]).save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_rgb(tmp_path / "a.png"), np.repeat(rgb[..., :1], 3, axis=-1))


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_sixteen_bits_are_rounded_to_eight_not_cut_off(tmp_path, channels):
    shape = (HEIGHT, WIDTH, channels)[: 2 if channels == 1 else 3]
    values = np.random.default_rng(2).integers(0, 65536, shape, dtype=np.uint16)
    if channels == 4:
        values[..., 3] = 65535
    cv2.imwrite(str(tmp_path / "a.png"), values)
    expected = np.round(values.astype(np.float64) / 65535 * 255)
    expected = np.repeat(expected[..., None], 3, -1) if channels == 1 else expected[..., 2::-1]
    np.testing.assert_array_equal(read_rgb(tmp_path / "a.png"), expected)


def test_palettes_are_looked_up_in_pictures_and_left_alone_in_labels(tmp_path):
    indices = np.random.default_rng(3).integers(0, 5, (HEIGHT, WIDTH), dtype=np.uint8)
    colours = np.random.default_rng(4).integers(0, 256, (5, 3), dtype=np.uint8)
    image = Image.fromarray(indices, "L")
    image = Image.frombytes("P", image.size, image.tobytes())
    image.putpalette(colours.tobytes())
    image.save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_rgb(tmp_path / "a.png"), colours[indices])
    np.testing.assert_array_equal(read_uint8(tmp_path / "a.png"), indices)


def test_transparent_areas_are_laid_on_white(tmp_path, rgb):
    alpha = np.random.default_rng(5).integers(0, 256, (HEIGHT, WIDTH, 1), dtype=np.uint8)
    alpha[0], alpha[1] = 0, 255
    Image.fromarray(np.concatenate((rgb, alpha), axis=-1)).save(tmp_path / "a.png")
    picture = read_rgb(tmp_path / "a.png")
    assert read_header(tmp_path / "a.png").transparent
    assert (picture[0] == 255).all()
    np.testing.assert_array_equal(picture[1], rgb[1])
    weight = alpha / 255
    assert np.abs(picture - (rgb * weight + 255 * (1 - weight))).max() <= 0.5 + 1e-6


def test_cmyk_is_refused(tmp_path):
    Image.new("CMYK", (WIDTH, HEIGHT), (10, 20, 30, 40)).save(tmp_path / "a.jpg")
    with pytest.raises(InputError, match="mode CMYK; convert it to sRGB"):
        read_rgb(tmp_path / "a.jpg")


@pytest.mark.parametrize("orientation", [5, 6, 7, 8])
def test_the_cameras_size_tells_whether_an_exif_rotation_counts(tmp_path, rgb, orientation):
    path = oriented(tmp_path / "a.png", rgb, orientation)
    with Image.open(path) as image:
        upright = np.array(ImageOps.exif_transpose(image))
    np.testing.assert_array_equal(read_rgb(path, (WIDTH, HEIGHT)), upright)
    np.testing.assert_array_equal(read_rgb(path, (HEIGHT, WIDTH)), rgb)
    assert read_grey(path, (WIDTH, HEIGHT), 1000).shape == (WIDTH, HEIGHT)
    assert (
        np.abs(read_grey(path, (WIDTH, HEIGHT), 1000) - cv2.cvtColor(upright, cv2.COLOR_RGB2GRAY).astype(int)).max()
        <= 1
    )


@pytest.mark.parametrize(
    ("orientation", "shape", "size"),
    [
        (6, (24, 37), None),
        (3, (24, 37), (24, 37)),
        (2, (24, 37), None),
        (6, (24, 24), (24, 24)),
        (8, (24, 37), (12, 18)),
    ],
    ids=["an unknown camera size", "half turn", "mirrored", "square", "another size"],
)
def test_an_exif_rotation_that_the_camera_cannot_decide_is_refused(tmp_path, rgb, orientation, shape, size):
    path = oriented(tmp_path / "a.png", np.ascontiguousarray(rgb[: shape[0], : shape[1]]), orientation)
    with pytest.raises(InputError, match=r"a\.png"):
        read_rgb(path, size)


def test_a_picture_of_another_size_than_its_camera_is_refused_with_both_sizes(tmp_path, rgb):
    write_png(tmp_path / "a.png", rgb)
    with pytest.raises(InputError, match=r"expected 18x12 pixels .* found 37x24"):
        read_rgb(tmp_path / "a.png", (12, 18))


@pytest.mark.parametrize("kind", ["jpg", "png", "16-bit.png"])
@pytest.mark.parametrize("read", [read_rgb, lambda path: read_grey(path, (120, 90), 100)])
def test_pictures_cut_short_are_refused(tmp_path, kind, read):
    path = tmp_path / f"a.{kind}"
    pixels = np.random.default_rng(6).integers(0, 256, (120, 90, 3)).astype(np.uint8)
    cv2.imwrite(str(path), pixels.astype(np.uint16) * 257 if "16" in kind else pixels)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match="expected a complete image"):
        read(path)


@pytest.mark.parametrize("cut", [1, 12, 16, 20])
def test_a_16_bit_png_without_its_last_bytes_is_refused_and_nothing_is_printed(tmp_path, capfd, cut):
    pixels = np.random.default_rng(6).integers(0, 65536, (HEIGHT, WIDTH, 3)).astype(np.uint16)
    cv2.imwrite(str(tmp_path / "a.png"), pixels)
    (tmp_path / "a.png").write_bytes((tmp_path / "a.png").read_bytes()[:-cut])
    with pytest.raises(InputError, match=r"a\.png: expected a complete image, found a truncated one"):
        read_rgb(tmp_path / "a.png")
    assert capfd.readouterr().err == ""


def test_pictures_beyond_the_bound_are_refused_from_their_header(tmp_path):
    """13000x13000, of which the smallest file has no pixels at all."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    for width, height in ((13000, 13000), (8193, 8192)):
        header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
        (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", b"") + chunk(b"IEND", b""))
        for read in (read_header, read_rgb, read_uint8, read_uint16):
            with pytest.raises(InputError, match=f"of at most 67,108,864 pixels, found {width}x{height}"):
                read(tmp_path / "a.png")


@pytest.mark.parametrize("content", [b"", b"not a picture", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff"])
def test_what_is_no_picture_is_refused(tmp_path, content):
    (tmp_path / "a.png").write_bytes(content)
    for read in (read_rgb, read_header, read_uint8, read_uint16):
        with pytest.raises(InputError, match=r"a\.png"):
            read(tmp_path / "a.png")


def test_other_formats_and_missing_files_are_refused(tmp_path, rgb):
    Image.fromarray(rgb).save(tmp_path / "a.bmp")
    for path in (tmp_path / "a.bmp", tmp_path / "absent.png", tmp_path):
        with pytest.raises(InputError):
            read_rgb(path)
        with pytest.raises(InputError):
            read_header(path)


def test_damaged_png_data_are_refused(tmp_path, rgb):
    buffer = io.BytesIO()
    Image.fromarray(rgb).save(buffer, "PNG")
    data = bytearray(buffer.getvalue())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(InputError):
        read_rgb(tmp_path / "a.png")


def test_depth_needs_sixteen_bits_and_labels_need_eight(tmp_path, rgb):
    write_png(tmp_path / "8.png", rgb[..., 0])
    write_png(tmp_path / "16.png", rgb[..., 0].astype(np.uint16))
    write_png(tmp_path / "rgb.png", rgb)
    for read, name in ((read_uint16, "8"), (read_uint16, "rgb"), (read_uint8, "16"), (read_uint8, "rgb")):
        with pytest.raises(InputError, match="PNG of one channel"):
            read(tmp_path / f"{name}.png")


def test_counts_of_a_pgm_are_taken_as_they_are(tmp_path):
    (tmp_path / "a.pgm").write_bytes(b"P5 3 # across\n2\t4096\n" + bytes([0, 1, 1, 0, 16, 0, 0, 0, 255, 255, 2, 3]))
    np.testing.assert_array_equal(read_uint16(tmp_path / "a.pgm"), [[1, 256, 4096], [0, 65535, 515]])


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"P5 3 2 65535\n" + bytes(11), "expected a complete image, found 11 bytes of 3x2 counts"),
        (b"P5 999999999 999999999 65535\n" + bytes(12), "expected a complete image, found 12 bytes of 999999999x"),
        (b"P5 3 2 255\n" + bytes(6), "expected a 16-bit PGM .* found one with largest count 255"),
        (b"P2 3 2 65535\n1 2 3 4 5 6", "expected a 16-bit PGM .* found something else"),
        (b"", "expected a 16-bit PGM .* found something else"),
    ],
)
def test_other_pgms_are_refused(tmp_path, content, message):
    (tmp_path / "a.pgm").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_uint16(tmp_path / "a.pgm")


def test_grey_pictures_for_features_are_reduced_in_proportion(tmp_path):
    Image.fromarray(smooth()).save(tmp_path / "a.jpg", quality=95)
    grey = read_grey(tmp_path / "a.jpg", (200, 310), 100)
    assert grey.shape == (65, 100)
    expected = cv2.resize(cv2.cvtColor(smooth(), cv2.COLOR_RGB2GRAY), (100, 65), interpolation=cv2.INTER_AREA)
    assert np.abs(grey.astype(int) - expected).max() <= 6


def heic(pixels: np.ndarray, **more: object) -> bytes:
    """A HEIC of full colour resolution, which keeps pixels to a few levels."""
    pillow_heif = pytest.importorskip("pillow_heif")
    buffer = io.BytesIO()
    pillow_heif.from_pillow(Image.fromarray(pixels)).save(buffer, quality=95, chroma="444", **more)
    return buffer.getvalue()


def test_a_heic_comes_out_as_it_was_drawn(tmp_path):
    path, pixels = tmp_path / "IMG_0001.HEIC", smooth()
    path.write_bytes(heic(pixels))
    assert read_header(path) == PictureHeader((200, 310), 1, False)
    for read in (read_rgb(path, (200, 310)), decode_rgb(path.read_bytes(), path)):
        assert np.abs(read.astype(int) - pixels).mean() < 2
    grey = read_grey(path, (200, 310), 155)
    assert grey.shape == (100, 155)
    assert abs(grey.mean() - cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY).mean()) < 1


def test_512_of_1023_in_a_heic_of_10_bits_is_half_of_255(tmp_path):
    """255 x 512 / 1023 = 127.6; read as 8 bits of 10, it would be four times too dark, or cut off at 255."""
    pillow_heif = pytest.importorskip("pillow_heif")
    counts = np.full((32, 48, 3), 512, np.uint16)
    counts[:, 24:] = 1023
    image = pillow_heif.from_bytes("RGB;16", (48, 32), (counts << 6).tobytes())
    image.save(tmp_path / "a.heic", quality=95, chroma="444")
    assert pillow_heif.open_heif(tmp_path / "a.heic", convert_hdr_to_8bit=False).info["bit_depth"] == 10
    read = read_rgb(tmp_path / "a.heic").astype(float)
    assert np.abs(read[:, 2:22] - 127.6).max() < 2
    assert read[:, 26:].min() > 253


def test_the_rotation_of_a_heic_is_applied_once(tmp_path):
    path, pixels = tmp_path / "IMG_0001.heic", smooth()
    exif = Image.Exif()
    exif[0x0112] = 6  # shown a quarter turn clockwise
    path.write_bytes(heic(pixels, exif=exif.tobytes()))
    assert read_header(path).size == (310, 200)
    turned = read_rgb(path, (310, 200))
    assert np.abs(turned.astype(int) - np.rot90(pixels, -1)).mean() < 2
    with pytest.raises(InputError, match=r"expected 310x200 pixels .*found 200x310"):
        read_rgb(path, (200, 310))


@pytest.mark.parametrize("left", [20, 100, 300, -20])
def test_a_damaged_heic_is_refused(tmp_path, left):
    path = tmp_path / "IMG_0001.heic"
    path.write_bytes(heic(smooth())[:left])
    with pytest.raises(InputError, match=r"IMG_0001\.heic: expected a"):
        read_rgb(path)


def test_a_heic_without_pillow_heif_says_what_to_install(tmp_path, monkeypatch):
    path = tmp_path / "IMG_0001.heic"
    path.write_bytes(b"\0\0\0\x1cftypheic" + bytes(100))
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    with pytest.raises(
        ImportError, match=r"IMG_0001\.heic is a HEIC image, which needs pillow-heif: pip install -e '\.\[phone\]'"
    ):
        read_header(path)


def test_an_empty_colour_profile_behind_the_pixels_is_damage(tmp_path: Path):
    """Found by fuzzing: Pillow raises IndexError there."""
    path = tmp_path / "0.png"
    write_png(path, np.full((3, 5, 3), 90, np.uint8))
    whole = path.read_bytes()
    end = whole.index(b"IEND") - 4
    chunk = struct.pack(">I", 0) + b"iCCP" + struct.pack(">I", zlib.crc32(b"iCCP"))
    path.write_bytes(whole[:end] + chunk + whole[end:])
    with pytest.raises(InputError, match=r"0\.png"):
        read_rgb(path)


@pytest.mark.parametrize(("read", "dtype"), [(read_uint8, np.uint8), (read_uint16, np.uint16)])
def test_a_chunk_that_claims_two_gigabytes_takes_no_memory(tmp_path: Path, read, dtype):
    counts = np.arange(12 * 16, dtype=dtype).reshape(12, 16)
    data = bytearray(png_bytes(counts))
    at = data.index(b"IDAT") - 4
    data[at : at + 4] = struct.pack(">I", (1 << 31) - 1)
    (tmp_path / "map.png").write_bytes(data)
    assert np.array_equal(read(tmp_path / "map.png"), counts)  # the pixels themselves are complete
    assert most_memory(lambda: read(tmp_path / "map.png")) < 10_000_000


def test_a_png_of_too_many_pixels_is_not_decoded(monkeypatch: pytest.MonkeyPatch):
    data = png_bytes(np.arange(48, dtype=np.uint16).reshape(6, 8) * 1000)
    decoded = decode_png(data)
    assert decoded is not None
    assert decoded.tolist() == (np.arange(48).reshape(6, 8) * 1000).tolist()
    assert decode_png(data[:-30]) is None or decode_png(data[:20]) is None
    assert decode_png(b"\xff\xd8\xff") is None
    monkeypatch.setattr("semgs.files.images.pictures.MOST_PIXELS", 47)
    assert decode_png(data) is None


@pytest.mark.parametrize("height", [1, 255, 256, 257, 700])
def test_images_of_any_height_are_blended_with_white_in_strips(tmp_path: Path, height: int):
    pixels = np.random.default_rng(height).integers(0, 256, (height, 3, 4), np.uint8)
    (tmp_path / "a.png").write_bytes(png_bytes(pixels))
    alpha = pixels[..., 3:] / 255
    white = pixels[..., :3] * alpha + 255 * (1 - alpha)
    assert np.abs(read_rgb(tmp_path / "a.png") - white).max() <= 0.5 + 1e-9


@pytest.mark.parametrize("height", [255, 513])
def test_sixteen_bits_are_rounded_to_eight_in_strips(tmp_path: Path, height: int):
    counts = np.random.default_rng(height).integers(0, 1 << 16, (height, 5), np.uint16)
    (tmp_path / "a.png").write_bytes(png_bytes(counts))
    assert (read_rgb(tmp_path / "a.png")[..., 0] == np.floor(counts / 257 + 0.5)).all()


def test_a_transparent_image_takes_little_more_memory_than_its_pixels(tmp_path: Path):
    """4,000x4,000 pixels are 64 MB with and 48 MB without alpha; before, sums of 32 bits took 500 MB."""
    (tmp_path / "a.png").write_bytes(png_bytes(np.full((4000, 4000, 4), 90, np.uint8)))
    assert most_memory(lambda: read_rgb(tmp_path / "a.png")) < 200e6


def with_chunk(name: bytes, content: bytes) -> bytes:
    """A PNG of 8x6 pixels with a chunk behind its header."""
    data = png_bytes(np.full((6, 8, 3), 90, np.uint8))
    chunk = struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
    return data[:33] + chunk + data[33:]


ZEROS = zlib.compress(bytes(50_000_000), 9)
"""50 MB in 49 kB."""


@pytest.mark.parametrize(
    ("name", "content"),
    [
        (b"zTXt", b"Comment\0\0" + ZEROS),
        (b"iTXt", b"Comment\0\1\0\0\0" + ZEROS),
        (b"iTXt", b"XML:com.adobe.xmp\0\1\0\0\0" + ZEROS),
        (b"iCCP", b"profile\0\0" + ZEROS),
    ],
)
def test_chunks_beside_the_pixels_are_not_inflated_without_limit(tmp_path: Path, name: bytes, content: bytes):
    (tmp_path / "a.png").write_bytes(with_chunk(name, content))

    def read() -> None:
        for reader in (read_header, read_optics, read_upright, read_rgb):
            with contextlib.suppress(InputError):
                reader(tmp_path / "a.png")

    assert most_memory(read) < 10_000_000


def test_of_an_animated_image_one_frame_is_decoded(tmp_path: Path):
    frames = [Image.new("RGB", (1000, 800), (number, 0, 0)) for number in range(60)]
    frames[0].save(tmp_path / "a.png", save_all=True, append_images=frames[1:])
    frames[0].save(tmp_path / "a.jpg", format="MPO", save_all=True, append_images=frames[1:])
    for path in (tmp_path / "a.png", tmp_path / "a.jpg"):
        assert most_memory(lambda path=path: read_rgb(path)) < 12_000_000  # one frame has 2.4 MB
        assert read_rgb(path).shape == (800, 1000, 3)


def with_exif(
    path: Path, *entries: tuple[int, int, bytes], pointer: bytes = struct.pack("<HHII", 0x8769, 4, 1, 26)
) -> Path:
    """A JPEG of 64x48 pixels whose EXIF data has these entries of 8 bytes: tag, type and value."""
    start = 26 + 2 + 12 * len(entries) + 4
    table = b"".join(
        struct.pack("<HHII", tag, kind, 1, start + 8 * number) for number, (tag, kind, _) in enumerate(entries)
    )
    values = b"".join(value for _, _, value in entries)
    first = b"II*\0" + struct.pack("<IH", 8, 1) + pointer + bytes(4)
    data = first + struct.pack("<H", len(entries)) + table + bytes(4) + values
    Image.new("RGB", (64, 48)).save(path, "JPEG", exif=b"Exif\0\0" + data)
    return path


@pytest.mark.parametrize("millimetres", [1e308, 1e12, 1e-320])
def test_focal_lengths_that_no_camera_has_are_none(tmp_path: Path, millimetres: float):
    assert read_optics(with_exif(tmp_path / "a.jpg", (0xA405, 12, struct.pack("<d", millimetres)))).focal_px is None
    long = struct.pack("<d", 1e300)
    assert read_optics(with_exif(tmp_path / "b.jpg", (0x920A, 12, long), (0xA20E, 12, long))).focal_px is None


def test_a_focal_length_of_26_millimetres_is_48_pixels_of_80(tmp_path: Path):
    """The diagonal has 80 px and 43.27 mm."""
    found = read_optics(with_exif(tmp_path / "a.jpg", (0xA405, 12, struct.pack("<d", 26.0)))).focal_px
    assert found == pytest.approx(48.07, abs=0.01)


def test_a_place_of_exif_data_before_the_file_is_damage(tmp_path: Path):
    with pytest.raises(InputError, match="expected readable EXIF data or none"):
        read_optics(with_exif(tmp_path / "a.jpg", pointer=struct.pack("<HHIi", 0x8769, 9, 1, -5)))


def test_a_heic_whose_pixels_are_more_than_it_says_is_damaged(tmp_path: Path):
    heif = pytest.importorskip("pillow_heif")
    heif.register_heif_opener()
    data = io.BytesIO()
    noise = np.random.default_rng(0).integers(0, 255, (1024, 1024, 3), np.uint8)
    Image.fromarray(noise).save(data, "HEIF", quality=20)
    lying = bytearray(data.getvalue())
    at = lying.find(b"ispe")
    while at >= 0:
        lying[at + 8 : at + 16] = struct.pack(">II", 64, 64)
        at = lying.find(b"ispe", at + 1)
    (tmp_path / "a.heic").write_bytes(lying)
    with pytest.raises(InputError):
        read_upright(tmp_path / "a.heic")


def png_of(*chunks: tuple[bytes, bytes]) -> bytes:
    """A PNG of 2 x 1 grey pixels of 16 bits, 258 and 772, with further chunks before the pixels."""
    header = (b"IHDR", struct.pack(">2I5B", 2, 1, 16, 0, 0, 0, 0))
    pixels = (b"IDAT", zlib.compress(b"\0\1\2\3\4"))
    every = [header, *chunks, pixels, (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        for name, content in every
    )


def test_nothing_of_a_png_is_printed(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    """libpng prints the name of a colour profile that it does not like: a title for the terminal, or a line for a program that listens."""
    data = png_of(
        (b"iCCP", b"a\n\x1b]0;PWNED\x07\0\0" + zlib.compress(400 * b"x")), (b"tIME", b""), (b"zzZz", b"\x1b[2J")
    )
    (tmp_path / "a.png").write_bytes(data)
    np.testing.assert_array_equal(decode_png(data), [[258, 772]])
    np.testing.assert_array_equal(read_uint16(tmp_path / "a.png"), [[258, 772]])
    read_rgb(tmp_path / "a.png")
    assert capfd.readouterr() == ("", "")


def with_scans(path: Path, more: int) -> Path:
    """A progressive JPEG whose last scan is there so many times more."""
    Image.new("RGB", (WIDTH, HEIGHT), (10, 200, 30)).save(path, progressive=True)
    data = path.read_bytes()
    last = data[data.rindex(b"\xff\xda") : -2]
    path.write_bytes(data[:-2] + more * last + data[-2:])
    return path


def test_a_jpeg_has_few_scans_because_each_passes_over_the_image(tmp_path: Path):
    """Pillow writes ten."""
    assert read_rgb(with_scans(tmp_path / "a.jpg", 90)).shape == (HEIGHT, WIDTH, 3)
    path = with_scans(tmp_path / "b.jpg", 91)
    for read in (read_rgb, read_upright, lambda one: read_grey(one, (HEIGHT, WIDTH), 9)):
        with pytest.raises(InputError, match=r"b\.jpg: expected a JPEG of at most 100 scans and 10,000 segments"):
            read(path)


def test_markers_in_a_jpegs_comments_and_behind_it_are_no_scans(tmp_path: Path):
    path = with_scans(tmp_path / "a.jpg", 0)
    data = path.read_bytes()
    text = 200 * b"\xff\xda" + b"\xff\xd9"
    path.write_bytes(data[:2] + b"\xff\xfe" + struct.pack(">H", 2 + len(text)) + text + data[2:] + 200 * b"\xff\xda")
    assert read_rgb(path).shape == (HEIGHT, WIDTH, 3)
    path.write_bytes(data[:2] + 10_001 * b"\xff\xfe\0\2" + data[2:])
    with pytest.raises(InputError, match="10,000 segments"):
        read_rgb(path)


def test_scans_are_counted_in_jpegs_of_several_images_and_behind_markers_without_a_length(tmp_path: Path):
    """Pillow calls a JPEG that says it has a second image MPO; libjpeg reads FF 01 as a marker alone."""
    image = Image.new("RGB", (WIDTH, HEIGHT), (10, 200, 30))
    image.save(tmp_path / "a.jpg", format="MPO", save_all=True, append_images=[image])
    with Image.open(tmp_path / "a.jpg") as opened:
        assert opened.format == "MPO"
    assert read_rgb(tmp_path / "a.jpg").shape == (HEIGHT, WIDTH, 3)
    data = (tmp_path / "a.jpg").read_bytes()
    scan = b"\xff\xda\0\x08\1\1\0\0\x3f\0"
    for between in (b"", b"\xff\x01", b"\xff\xd8", b"\xff\xbf"):
        many = data[:2] + 101 * (scan + between) + data[2:]
        (tmp_path / "b.jpg").write_bytes(many)
        with pytest.raises(InputError, match=r"at most 100 scans|something else or a damaged header|complete image"):
            read_rgb(tmp_path / "b.jpg")
        with pytest.raises(InputError, match="at most 100 scans"):
            _check_scans("b.jpg", many)


def test_transparent_colours_beyond_a_palette_are_damage(tmp_path: Path):
    data = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))
        for name, content in (
            (b"IHDR", struct.pack(">2I5B", 1, 1, 8, 3, 0, 0, 0)), (b"PLTE", b"\1\2\3"), (b"tRNS", bytes(300)),
            (b"IDAT", zlib.compress(b"\0\0")), (b"IEND", b""),
        )
    )  # fmt: skip
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(InputError, match=r"a\.png: expected a palette and transparent colours that fit it"):
        read_rgb(tmp_path / "a.png")


def test_depth_in_tiff_is_read_as_it_was_written(tmp_path):
    """What we write, counts of either order of bytes, and compressed ones."""
    values = np.linspace(0.5, 4.5, 20, dtype=np.float32).reshape(4, 5)
    write_tiff(tmp_path / "own.tiff", values)
    np.testing.assert_array_equal(read_tiff(tmp_path / "own.tiff"), values)
    Image.fromarray(values).save(tmp_path / "packed.tiff", compression="tiff_adobe_deflate")
    np.testing.assert_array_equal(read_tiff(tmp_path / "packed.tiff"), values)
    counts = np.arange(20, dtype=np.uint16).reshape(4, 5) * 3000
    Image.fromarray(counts).save(tmp_path / "counts.tif")
    Image.frombytes("I;16B", (5, 4), counts.astype(">u2").tobytes()).save(tmp_path / "big.tif")
    for name in ("counts.tif", "big.tif"):
        found = read_tiff(tmp_path / name)
        assert found.dtype == np.uint16
        np.testing.assert_array_equal(found, counts)
    names = ("own.tiff", "counts.tif", "none.tiff", "own.npy")
    assert [is_float_tiff(tmp_path / name) for name in names] == [True, False, False, False]


def test_other_tiffs_are_no_depth(tmp_path):
    path = tmp_path / "a.tiff"
    expected = "expected a TIFF of one channel, of 16 bits or of floating-point numbers, found one of mode"
    for values, mode in ((np.zeros((4, 5, 3), np.uint8), "RGB"), (np.zeros((4, 5), np.uint8), "L")):
        Image.fromarray(values).save(path)
        with pytest.raises(InputError, match=f"{expected} {mode}"):
            read_tiff(path)
    path.write_bytes(b"no TIFF")
    with pytest.raises(InputError, match="expected a TIFF image, found something else or a damaged header"):
        read_tiff(path)


def test_a_damaged_tiff_is_refused_or_read_without_warnings(tmp_path):
    """Every byte of the header and its tags is changed, and the file is cut everywhere."""
    path = tmp_path / "a.tiff"
    Image.fromarray(np.ones((3, 4), np.float32)).save(path)
    whole, refused = path.read_bytes(), 0
    variants = [whole[:place] + bytes([255 - whole[place]]) + whole[place + 1 :] for place in range(len(whole))]
    for data in (*variants, *(whole[:length] for length in range(len(whole)))):
        path.write_bytes(data)
        try:
            read_tiff(path)
        except InputError:
            refused += 1
        is_float_tiff(path)
    assert refused > len(whole)
