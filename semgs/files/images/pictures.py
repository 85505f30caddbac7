"""Images: JPEG, PNG and HEIC (and PGM and TIFF for depth) to arrays, and arrays to PNG and JPEG.

All images become 8-bit RGB: 16 bits are rounded to 8, grey is repeated, palettes are looked up, and transparent areas become white (as
NeRF's synthetic scenes expect). Ambiguous files are refused: CMYK, truncated images, and an EXIF rotation that the camera's size neither
confirms nor rules out.
"""

from __future__ import annotations

import io
import math
import re
import struct
import warnings
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image, UnidentifiedImageError

from semgs.files.atomic import write_bytes
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError
from semgs.files.images.colours import Colour
from semgs.files.images.heic import is_heic, open_heic
from semgs.files.stored import Stored, stored

FORMATS = ("JPEG", "PNG")
TIFFS = (".tif", ".tiff")
"""Endings of TIFF files, in lower case."""

MOST_PIXELS = 1 << 26
"""Larger images are not decoded: 67 megapixels, 0.8 GB as float32."""

STRIP = 256
"""Rows of an image that are blended at a time."""

MOST_SCANS, MOST_SEGMENTS = 100, 10_000
"""Of a JPEG: each scan passes over the whole image. Cameras and programs write about ten."""

_PIXEL_CHUNKS = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")
"""What the pixels of a PNG depend on. libpng prints what is wrong with the rest, with texts of the file."""
_MARKER = re.compile(rb"\xff([\xc0-\xcf\xd9-\xfe])")
"""A JPEG's marker that a length follows, or its end, https://www.w3.org/Graphics/JPEG/itu-t81.pdf#page=36"""
_SCAN, _END = b"\xda", b"\xd9"
_PNG_END = b"\0\0\0\0IEND\xaeB`\x82"
_PGM = re.compile(rb"P5" + rb"(?:\s|#[^\n]*\n)+(\d{1,9})" * 3 + rb"\s")
"""A PGM header: width, height and largest count, separated by spaces and comments, then one space before the counts."""
_ORIENTATION = 0x0112
_EXIF, _FOCAL_MM, _FOCAL_35_MM, _PLANE_X, _PLANE_UNIT, _CUSTOM = 0x8769, 0x920A, 0xA405, 0xA20E, 0xA210, 0xA401
_TAKEN_WIDTH, _TAKEN_HEIGHT = 0xA002, 0xA003
_DIAGONAL_35_MM = math.hypot(36, 24)
_PANORAMA = 6
"""What iPhones write as CustomRendered of a panorama."""
_MM = {2: 25.4, 3: 10.0}
"""Millimetres of FocalPlaneResolutionUnit: inches, centimetres."""
MOST_FOCAL_PX = 1e6
"""A longer focal length is damage: telescopes have less [px]."""
_SIXTEEN_BITS = ("I;16", "I;16B", "I;16L")
_SCALED = {2: 85, 4: 17}
"""By what Pillow multiplies greys of so many bits."""
_PALETTE = 3
"""A PNG's colour type, https://www.w3.org/TR/png-3/#11IHDR"""
_DAMAGE = (
    OSError,
    SyntaxError,
    ValueError,
    EOFError,
    IndexError,
    OverflowError,
    RuntimeError,
    TypeError,
    KeyError,
    struct.error,
    zlib.error,
    Image.DecompressionBombError,
)
"""What Pillow raises for damaged files, depending on the format and the damage."""


_TURNS = {
    2: lambda pixels: pixels[:, ::-1],
    3: lambda pixels: np.rot90(pixels, 2),
    4: lambda pixels: pixels[::-1],
    5: lambda pixels: pixels.swapaxes(0, 1),
    6: lambda pixels: np.rot90(pixels, -1),
    7: lambda pixels: np.rot90(pixels, 2).swapaxes(0, 1),
    8: lambda pixels: np.rot90(pixels, 1),
}
"""From stored to upright pixels, for each EXIF orientation but 1."""

QUARTER_TURN = 5
"""EXIF orientations from this one swap height and width."""


@dataclass(frozen=True)
class PictureHeader:
    """What an image's header says.

    Attributes:
        size: (height, width) of the pixels as stored [px].
        orientation: EXIF orientation, 1 (as stored) to 8.
        transparent: whether it has an alpha channel or a transparent colour.
    """

    size: tuple[int, int]
    orientation: int
    transparent: bool


@dataclass(frozen=True)
class Optics:
    """What EXIF and XMP data say about how an image was taken.

    Attributes:
        focal_px: focal length in pixels of the stored image; None if unknown.
        panorama: whether it was stitched from several.
    """

    focal_px: float | None
    panorama: bool


def read_optics(path: str | Stored) -> Optics:
    """How an image was taken.

    The focal length comes from FocalLengthIn35mmFilm, which compares diagonals: 26 mm on an image of 4000x3000 are 26 * 5000 / 43.27 pixels. If it
    is missing, it comes from FocalLength and FocalPlaneXResolution, which counts pixels as they were taken: programs that make photos smaller keep it, and
    PixelXDimension and PixelYDimension beside it.

    Raises:
        InputError: the file is missing, or is not a JPEG, PNG or HEIC.
        ImportError: it is a HEIC, and pillow-heif is not installed.
    """
    with _opened(path) as image:
        try:
            exif = _readable_exif(path, image).get_ifd(_EXIF)
        except _DAMAGE as error:
            raise InputError(path, "readable EXIF data or none", str(error)) from error
        equivalent, focal, per_unit = (_positive(exif.get(tag)) for tag in (_FOCAL_35_MM, _FOCAL_MM, _PLANE_X))
        xmp = image.info.get("xmp", b"")
        stitched = exif.get(_CUSTOM) == _PANORAMA or b"GPano:" in (xmp if isinstance(xmp, bytes) else str(xmp).encode())
        if equivalent:
            return Optics(_possible_focal(equivalent * math.hypot(*image.size) / _DIAGONAL_35_MM), stitched)
        unit = _MM.get(exif.get(_PLANE_UNIT, 2))
        if not (focal and per_unit and unit):
            return Optics(None, stitched)
        taken = [side for tag in (_TAKEN_WIDTH, _TAKEN_HEIGHT) if (side := _positive(exif.get(tag)))]
        shrunk = max(image.size) / max(taken) if len(taken) == 2 else 1.0
        return Optics(_possible_focal(focal * per_unit / unit * shrunk), stitched)


def read_upright(path: str | Stored) -> np.ndarray:
    """An image as uint8 [h w 3], RGB, turned as its EXIF orientation says.

    Raises:
        InputError: it is missing, truncated or CMYK, or has another format.
        ImportError: it is a HEIC, and pillow-heif is not installed.
    """
    data = read_bytes(path, "an image")
    with _opened(path, data) as image:
        _decode(path, image)
        turn = _TURNS.get(_header(path, image).orientation, lambda pixels: pixels)
        return np.ascontiguousarray(turn(_rgb(data, path, image)))


def read_header(path: str | Stored) -> PictureHeader:
    """Size, orientation and transparency of an image.

    Raises:
        InputError: the file is missing, or is not a JPEG, PNG or HEIC.
        ImportError: it is a HEIC, and pillow-heif is not installed.
    """
    with _opened(path) as image:
        return _header(path, image)


def is_turned(path: str | Stored, header: PictureHeader, size: tuple[int, int] | None) -> bool:
    """Whether to apply the EXIF rotation of an image, so that its pixels match a camera of `size`.

    Some programs use the stored pixels, others the rotated ones. If the rotation swaps height and width, the camera's size shows which
    was used. Otherwise the image is refused, because a guess could be silently wrong.

    Args:
        path: the image, for the message.
        header: its header.
        size: (height, width) of its camera; None if unknown.

    Raises:
        InputError: the size fits neither the stored nor the rotated pixels, or it cannot decide about the rotation.
    """
    stored, turned = header.size, header.size[::-1]
    quarter_turn = header.orientation >= QUARTER_TURN
    if size is not None and size != stored and not (quarter_turn and size == turned):
        raise InputError(
            path,
            f"{size[1]}x{size[0]} pixels (width x height), as its camera says",
            f"{stored[1]}x{stored[0]}",
            advice="use the images that the cameras were made for, or cameras for these images",
        )
    if header.orientation == 1:
        return False
    if size is None or not quarter_turn or stored == turned:
        raise InputError(
            path,
            "an upright image, or a camera whose width and height show whether EXIF was applied",
            f"EXIF orientation {header.orientation} and "
            + ("an unknown camera size" if size is None else "a size that fits both ways"),
            advice="save the pixels as the cameras expect them, without the orientation tag",
        )
    return size == turned


def read_rgb(path: str | Stored, size: tuple[int, int] | None = None) -> np.ndarray:
    """An image as uint8 [h w 3], RGB.

    Args:
        path: a JPEG, PNG or HEIC: grey, palette or RGB, 8 or 16 bits, with or without alpha.
        size: (height, width) of its camera, which also decides whether an EXIF rotation is applied (see `is_turned`).

    Raises:
        InputError: it is missing, truncated or CMYK, has another format or size, or an ambiguous EXIF rotation.
    """
    return decode_rgb(read_bytes(path, "an image"), path, size)


def decode_rgb(data: bytes, path: str | Stored, size: tuple[int, int] | None = None) -> np.ndarray:
    """As `read_rgb`, for the bytes of an image.

    Args:
        data: the bytes.
        path: the file that they are from, for messages.
        size: as for `read_rgb`.

    Raises:
        InputError: as `read_rgb`.
    """
    with _opened(path, data) as image:
        _decode(path, image)
        header = _header(path, image)  # a PNG may have its EXIF data behind the pixels
        turn = is_turned(path, header, size)
        rgb = _rgb(data, path, image)
    return np.ascontiguousarray(_TURNS[header.orientation](rgb)) if turn else rgb


def _rgb(data: bytes, path: str | Stored, image: Image.Image) -> np.ndarray:
    """The stored pixels of a decoded image, uint8 [h w 3]."""
    if data[:4] != b"\x89PNG" or data[24] != 16:
        return _on_white(_channels(path, image))
    # Pillow accepts a file without its last bytes; OpenCV does not, and prints warnings.
    complete = _PNG_END in data
    decoded = decode_png(data) if complete else None
    if decoded is None:
        raise InputError(path, "a complete image", "a truncated one")
    return _on_white(_eight_bits(decoded))


def read_grey(path: str | Stored, size: tuple[int, int], longest: int) -> np.ndarray:
    """An image in grey, uint8 [h w], reduced so that its longer side is at most `longest` pixels.

    For feature detection, so it is fast rather than exact: JPEGs are decoded at reduced size.

    Args:
        path: the image.
        size: (height, width) of its camera, as for `read_rgb`.
        longest: largest longer side [px].

    Raises:
        InputError: as `read_rgb`.
    """
    scale = min(1.0, longest / max(size))
    with _opened(path) as image:
        if image.format == "JPEG" and image.mode in ("L", "RGB"):
            header = _header(path, image)
            turn = is_turned(path, header, size)
            image.draft("L", (math.ceil(image.width * scale), math.ceil(image.height * scale)))
            _decode(path, image)
            grey = _TURNS[header.orientation](np.asarray(image)) if turn else np.asarray(image)
        else:
            grey = cv2.cvtColor(read_rgb(path, size), cv2.COLOR_RGB2GRAY)
    height, width = (max(1, round(side * scale)) for side in size)
    return np.asarray(cv2.resize(np.ascontiguousarray(grey), (width, height), interpolation=cv2.INTER_AREA))


def read_uint16(path: str | Stored) -> np.ndarray:
    """A depth map: a 16-bit PNG or binary PGM with one channel, uint16 [h w]. PGM counts are not rescaled, whatever the stated maximum.

    Raises:
        InputError: it is missing, truncated, or something else.
    """
    if stored(path).suffix.lower() == ".pgm":
        return _pgm_counts(path, read_bytes(path, "an image"))
    return _typed(read_numbers(path), path, np.uint16, "a 16-bit PNG of one channel")


def read_tiff(path: str | Stored) -> np.ndarray:
    """A depth map: a TIFF of one channel and one page, uint16 or float32 [h w].

    Raises:
        InputError: it is missing, truncated, or something else.
    """
    with _opened_tiff(path) as image:
        _decode(path, image)
        if image.mode not in (*_SIXTEEN_BITS, "F"):
            expected = "a TIFF of one channel, of 16 bits or of floating-point numbers"
            raise InputError(path, expected, f"one of mode {image.mode}")
        return np.asarray(image).astype(np.float32 if image.mode == "F" else np.uint16)


def is_float_tiff(path: Stored) -> bool:
    """Whether a file is a TIFF of floating-point numbers; a damaged one is not."""
    if path.suffix.lower() not in TIFFS:
        return False
    with suppress(InputError), _opened_tiff(path) as image:
        return image.mode == "F"
    return False


@contextmanager
def _opened_tiff(path: str | Stored) -> Iterator[Image.Image]:
    """A TIFF with only its header read."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about the header
        with _opened(path, read_bytes(path, "an image"), ("TIFF",), "a TIFF image") as image:
            yield image


def _pgm_counts(path: str | Stored, data: bytes) -> np.ndarray:
    """The counts of a PGM, uint16 [h w]. https://netpbm.sourceforge.net/doc/pgm.html"""
    header = _PGM.match(data)
    width, height, most = (int(number) for number in header.groups()) if header else (0, 0, 0)
    if header is None or not 255 < most < 1 << 16:
        raise InputError(path, "a 16-bit PGM (P5)", f"one with largest count {most}" if header else "something else")
    if len(data) - header.end() < 2 * width * height:
        raise InputError(path, "a complete image", f"{len(data) - header.end()} bytes of {width}x{height} counts")
    return np.frombuffer(data, ">u2", width * height, header.end()).reshape(height, width).astype(np.uint16)


def read_uint8(path: str | Stored) -> np.ndarray:
    """The numbers of an 8-bit map, uint8 [h w], as `read_numbers`.

    Raises:
        InputError: it is missing, truncated, or something else.
    """
    return _typed(read_numbers(path), path, np.uint8, "an 8-bit PNG of one channel")


def read_visible(path: str | Stored) -> np.ndarray:
    """Where a mask shows its image, bool [h w]: pixels in the upper half of what its bits can say, as compressed masks have values in between. If it has
    two numbers, both in the lower half, such as 0 and 1: all pixels but those of 0.

    Raises:
        InputError: as `read_numbers`.
    """
    data = read_bytes(path, "an image")
    numbers, full = _numbers(data, path), (1 << _depth(data)) - 1
    counted = np.bincount(numbers.ravel())
    few = len(counted) <= full // 2 + 1 and np.count_nonzero(counted) <= 2
    return np.asarray(numbers > (0 if few else full // 2))


def read_numbers(path: str | Stored, colours: Mapping[Colour, int] | None = None) -> np.ndarray:
    """The numbers of a map (labels, ids, depth), uint8 or uint16 [h w]: a PNG of one channel, or of equal ones, with 1 to 16 bits, as they were written.

    Writers and optimisers may store them as a palette. If its colours are grey, these are the numbers. If they are those of classes, the numbers are
    the classes'. Otherwise the numbers are the indices.

    Args:
        path: the file.
        colours: the number of each class by its colour. A palette of other colours is then refused if pixels have all of them, because an optimiser may
            have renumbered it; None to read indices.

    Raises:
        InputError: it is missing, truncated, or something else.
    """
    return _numbers(read_bytes(path, "an image"), path, colours)


def _numbers(data: bytes, path: str | Stored, colours: Mapping[Colour, int] | None = None) -> np.ndarray:
    """As `read_numbers`, of the bytes of a file."""
    with _opened(path, data) as image:  # from memory, as Pillow asks files for as many bytes as chunks claim to have
        _decode(path, image)
        pixels, expected = np.asarray(image), "a PNG of one channel"
        if image.format != "PNG":
            raise InputError(path, expected, f"a {image.format}")
        if image.mode == "P":
            palette = np.array(image.getpalette(), np.uint8).reshape(-1, 3)
            return _by_palette(path, pixels, palette, colours)
        if image.mode in _SIXTEEN_BITS:
            return pixels.astype(np.uint16)
        if pixels.ndim == 2:
            return pixels.astype(np.uint8) // _SCALED.get(_depth(data), 1)
        grey, opaque = pixels[..., 0], image.mode == "RGB" or bool((pixels[..., -1] == 255).all())
        if _depth(data) != 8 or not opaque or (image.mode != "LA" and (pixels[..., 1:3] != grey[..., None]).any()):
            advice = None if colours is None else "convert its colours to class numbers"
            raise InputError(path, expected, f"a PNG of mode {image.mode}", advice=advice)
        return grey


def _depth(png: bytes) -> int:
    """Bits of a channel of a PNG; 8 for those of a palette."""
    return 8 if png[25] == _PALETTE else png[24]


def _typed(numbers: np.ndarray, path: str | Stored, dtype: type, expected: str) -> np.ndarray:
    """The numbers of a map, which must have this type."""
    if numbers.dtype != dtype:
        raise InputError(path, expected, f"a PNG of one channel with {8 * numbers.itemsize} bits")
    return numbers


def _by_palette(
    path: str | Stored, indices: np.ndarray, palette: np.ndarray, colours: Mapping[Colour, int] | None
) -> np.ndarray:
    """The numbers that pixels with a palette [n 3] mean, as `read_numbers` says."""
    used = np.unique(indices)
    if used[-1] >= len(palette):
        raise InputError(path, f"a palette of {used[-1] + 1} colours or more", f"{len(palette)}")
    shown = [(int(red), int(green), int(blue)) for red, green, blue in palette[used]]
    if all(red == green == blue for red, green, blue in shown):
        return palette[:, 0][indices]
    if colours is not None and all(colour in colours for colour in shown):
        numbers = np.zeros(256, np.uint8)
        numbers[used] = [colours[colour] for colour in shown]
        return numbers[indices]
    if colours is not None and len(used) == len(palette):
        raise InputError(
            path, "class numbers as grey, or a palette of the class table's colours", "a palette of other colours",
            advice="an image optimiser may have renumbered it; save the numbers as 8-bit grey",
        )  # fmt: skip
    return indices


def decode_png(data: bytes) -> np.ndarray | None:
    """The pixels of a PNG as OpenCV decodes them: BGR, 16 bits unchanged. None if it is damaged, something else, or larger than `MOST_PIXELS`."""
    if data[:4] != b"\x89PNG" or data[12:16] != b"IHDR" or len(data) < 24:
        return None
    width, height = struct.unpack(">2I", data[16:24])
    if width * height > MOST_PIXELS:
        return None
    decoded = cv2.imdecode(np.frombuffer(_pixel_chunks(data), np.uint8), cv2.IMREAD_UNCHANGED)
    return None if decoded is None else np.asarray(decoded)


def _pixel_chunks(data: bytes) -> bytes:
    """A PNG with `_PIXEL_CHUNKS` alone, as far as it is complete."""
    kept, place = [data[:8]], 8
    while place < len(data):
        end = place + 12 + int.from_bytes(data[place : place + 4], "big")
        if data[place + 4 : place + 8] in _PIXEL_CHUNKS:
            kept.append(data[place:end])
        place = end
    return b"".join(kept)


def write_png(path: str | Path, array: np.ndarray) -> None:
    """Write a PNG atomically: uint8 [h w 3] (RGB) or [h w 4] (RGBA), uint8 [h w] or uint16 [h w].

    Raises:
        ValueError: another type or shape.
    """
    write_bytes(Path(path), png_bytes(array))


def png_bytes(array: np.ndarray) -> bytes:
    """A PNG of uint8 [h w 3] (RGB) or [h w 4] (RGBA), uint8 [h w] or uint16 [h w].

    Raises:
        ValueError: another type or shape.
    """
    colour = array.dtype == np.uint8 and array.ndim == 3 and array.shape[2] in (3, 4)
    if not (colour or (array.dtype in (np.uint8, np.uint16) and array.ndim == 2)) or not array.size:
        raise ValueError(
            f"the image is {array.dtype} {array.shape}; expected uint8 [h w 3], [h w 4] or [h w], or uint16 [h w]"
        )
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(array)).save(buffer, "PNG", compress_level=4)
    return buffer.getvalue()


def write_tiff(path: str | Path, array: np.ndarray) -> None:
    """Write a TIFF atomically: 32-bit floats [h w], which may be NaN."""
    buffer = io.BytesIO()
    Image.fromarray(array.astype(np.float32)).save(buffer, "TIFF")
    write_bytes(path, buffer.getvalue())


def jpeg_bytes(array: np.ndarray, quality: int) -> bytes:
    """A JPEG of uint8 [h w 3] (RGB); quality 1 to 95."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(array)).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def _opened(
    path: str | Stored,
    data: bytes | None = None,
    formats: tuple[str, ...] = FORMATS,
    expected: str = "a JPEG or PNG image",
) -> Image.Image:
    """The image with only its header read."""
    file = stored(path)
    if data is None and not file.is_file():
        raise InputError(path, "an image", "no such file")
    if data is None and not isinstance(file, Path):
        data = read_bytes(file, "an image")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own limit below is lower
            image = Image.open(str(file) if data is None else io.BytesIO(data), formats=formats)
    except UnidentifiedImageError as error:
        data = read_bytes(file, expected) if data is None else data
        if formats is not FORMATS or not is_heic(data):
            raise InputError(path, expected, "something else or a damaged header") from error
        image = open_heic(path, data)
    except _DAMAGE as error:
        raise InputError(path, expected, str(error)) from error
    if image.width * image.height > MOST_PIXELS:
        image.close()
        raise InputError(path, f"an image of at most {MOST_PIXELS:,} pixels", f"{image.width}x{image.height}")
    return image


def _header(path: str | Stored, image: Image.Image) -> PictureHeader:
    """The header of an opened image."""
    orientation = _readable_exif(path, image).get(_ORIENTATION, 1)
    transparent = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
    known = isinstance(orientation, int) and 1 <= orientation <= 8
    return PictureHeader((image.height, image.width), orientation if known else 1, transparent)


def _readable_exif(path: str | Stored, image: Image.Image) -> Image.Exif:
    """The EXIF data of an opened image."""
    try:
        return Image.Image.getexif(image)  # PngImageFile's own would decode all pixels
    except _DAMAGE as error:
        raise InputError(path, "readable EXIF data or none", str(error)) from error


def _positive(value: object) -> float | None:
    """A positive, finite number of EXIF data, else None."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def _possible_focal(focal_px: float) -> float | None:
    """A focal length [px] that a camera can have, else None."""
    return focal_px if 1 <= focal_px < MOST_FOCAL_PX else None


def _decode(path: str | Stored, image: Image.Image) -> None:
    """Decode all pixels."""
    file: Any = getattr(image, "fp", None)  # None once the pixels are there
    if image.format in ("JPEG", "MPO") and file is not None:
        place = file.tell()
        file.seek(0)
        _check_scans(path, file.read())
        file.seek(place)
    try:
        image.load()
    except _DAMAGE as error:
        raise InputError(path, "a complete image", str(error)) from error


def _check_scans(path: str | Stored, data: bytes) -> None:
    """Refuse a JPEG of very many scans or segments."""
    place, scans, segments = 2, 0, 0
    while (found := _MARKER.search(data, place)) is not None and found[1] != _END:
        place = found.end() + int.from_bytes(data[found.end() : found.end() + 2], "big")
        scans, segments = scans + (found[1] == _SCAN), segments + 1
        if scans > MOST_SCANS or segments > MOST_SEGMENTS:
            raise InputError(path, f"a JPEG of at most {MOST_SCANS} scans and {MOST_SEGMENTS:,} segments", "more")


def _channels(path: str | Stored, image: Image.Image) -> np.ndarray:
    """The pixels of an 8-bit image as [h w 3] or, with alpha, [h w 4]."""
    if image.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA"):
        raise InputError(path, "grey or RGB pixels", f"mode {image.mode}", advice="convert it to sRGB first")
    transparent = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
    try:
        return np.array(image.convert("RGBA" if transparent else "RGB"))
    except _DAMAGE as error:
        raise InputError(path, "a palette and transparent colours that fit it", str(error)) from error


def _eight_bits(pixels: np.ndarray) -> np.ndarray:
    """16-bit pixels in OpenCV's order (grey, BGR or BGRA) as 8-bit RGB or RGBA."""
    reduced: np.ndarray = np.empty(pixels.shape, np.uint8)
    for rows in _strips(pixels):
        reduced[rows] = (pixels[rows].astype(np.uint32) + 128) // 257
    if reduced.ndim == 2:
        return np.repeat(reduced[..., None], 3, axis=-1)
    return np.ascontiguousarray(reduced[..., [2, 1, 0, 3][: reduced.shape[2]]])


def _on_white(pixels: np.ndarray) -> np.ndarray:
    """RGB pixels as they are; RGBA pixels blended with white."""
    if pixels.shape[2] == 3:
        return pixels
    white = np.empty((*pixels.shape[:2], 3), np.uint8)
    for rows in _strips(pixels):
        alpha = pixels[rows, :, 3:].astype(np.uint32)
        blend = pixels[rows, :, :3] * alpha + 255 * (255 - alpha)
        white[rows] = (blend + 127) // 255
    return white


def _strips(pixels: np.ndarray) -> Iterator[slice]:
    """Rows to compute at a time, so that sums of 32 bits take little memory beside the pixels."""
    for row in range(0, len(pixels), STRIP):
        yield slice(row, row + STRIP)
