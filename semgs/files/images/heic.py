"""HEIC, the format of iPhone photos, opened by pillow-heif."""

from __future__ import annotations

import io

from PIL.ImageFile import ImageFile

from semgs.files.errors import InputError, needs_extra
from semgs.files.stored import Stored

BRANDS = (b"heic", b"heix", b"heim", b"heis", b"mif1")
"""What follows `ftyp` at the beginning of such a file. ISO/IEC 23008-12."""


def is_heic(data: bytes) -> bool:
    """Whether the bytes of a file begin like a HEIC's."""
    return data[4:8] == b"ftyp" and data[8:12] in BRANDS


def open_heic(path: str | Stored, data: bytes) -> ImageFile:
    """A HEIC as an image of Pillow with only its header read. Its rotation is already applied.

    Args:
        path: its name, for errors.
        data: its bytes.

    Raises:
        InputError: it is damaged.
        ImportError: pillow-heif is not installed.
    """
    with needs_extra("phone", f"{path} is a HEIC image, which needs pillow-heif", "pillow_heif"):
        from pillow_heif import HeifImageFile
    try:
        return HeifImageFile(io.BytesIO(data))
    except (OSError, SyntaxError, ValueError, EOFError, RuntimeError) as error:
        raise InputError(path, "a HEIC image", f"a damaged one: {error}") from error
