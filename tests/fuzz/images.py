"""Images of each kind that is read."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np


def pictures(folder: Path) -> Path:
    from PIL import Image

    rng = np.random.default_rng(0)
    colour = rng.integers(0, 256, (24, 32, 3), np.uint8)
    deep = rng.integers(0, 65536, (24, 32), np.uint16)
    exif = Image.Exif()
    exif[0x0112] = 6
    made = Image.fromarray(colour)
    made.save(folder / "rgb.png")
    made.save(folder / "rgb.jpg", exif=exif)
    made.convert("L").save(folder / "grey.jpg", progressive=True)
    made.convert("RGBA").save(folder / "alpha.png")
    made.convert("P").save(folder / "palette.png", transparency=3)
    made.convert("L").save(folder / "labels.png")
    made.convert("1").save(folder / "bits.png")
    Image.fromarray(deep).save(folder / "depth.png")
    import cv2

    (folder / "deep.png").write_bytes(cv2.imencode(".png", np.stack((deep, deep[::-1], deep), -1))[1].tobytes())
    (folder / "depth.pgm").write_bytes(b"P5\n# counts\n32 24\n10000\n" + deep.astype(">u2").tobytes())
    from pillow_heif import from_pillow

    file = io.BytesIO()
    from_pillow(made.resize((64, 64))).save(file, format="HEIF", quality=50)
    (folder / "photo.heic").write_bytes(file.getvalue())
    np.save(folder / "depth.npy", deep.astype(np.float32))
    return folder


def read_pictures(path: Path, out: Path, changed: Sequence[str]) -> None:
    """Read each changed picture by every reader that it may meet."""
    from semgs.files import arrays
    from semgs.files.errors import InputError
    from semgs.files.images import pictures as readers

    refused, read = None, False
    for name in changed:
        file = path / name
        if file.suffix == ".npy":
            arrays.read_array(file)
            continue
        for reader in (
            readers.read_header, readers.read_rgb, lambda one: readers.read_grey(one, (24, 32), 16), readers.read_uint16, readers.read_uint8,
            readers.read_numbers, readers.read_visible, lambda one: readers.read_numbers(one, {}), lambda one: readers.read_rgb(one, (32, 24)),
        ):  # fmt: skip
            try:
                reader(file)
                read |= reader is not readers.read_header
            except InputError as error:
                refused = error
    if refused is not None and not read:
        raise refused
