"""Files that users drop on the page."""

from __future__ import annotations

import stat
import zipfile
from pathlib import Path

import numpy as np
from PIL import Image

from semgs.app.uploads import Upload


def picture(path: Path, size: tuple[int, int] = (60, 40), seed: int = 0, **options: object) -> Upload:
    """A JPEG of noise, (width, height)."""
    pixels = np.random.default_rng(seed).integers(0, 255, (size[1], size[0], 3), np.uint8)
    Image.fromarray(pixels).save(path, **options)  # type: ignore[arg-type]
    return Upload(path, path.name)


def written(path: Path, data: bytes) -> Upload:
    path.write_bytes(data)
    return Upload(path, path.name)


def zipped(path: Path, members: dict[str, bytes]) -> Upload:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return Upload(path, path.name)


def with_link(path: Path, kind: int = stat.S_IFLNK) -> Upload:
    with zipfile.ZipFile(path, "w") as archive:
        link = zipfile.ZipInfo("images/0.jpg")
        link.external_attr = (kind | 0o777) << 16
        archive.writestr(link, "/etc/passwd")
    return Upload(path, path.name)
