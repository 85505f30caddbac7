"""What the app accepts, and for how long it works and keeps results."""

from __future__ import annotations

from dataclasses import dataclass

MIB = 1 << 20


@dataclass(frozen=True)
class Limits:
    """Limits of the app.

    Attributes:
        file_bytes: of one uploaded file.
        total_bytes: of all files of a job.
        photos: of a job.
        pixels: of one photo.
        members: files in an archive.
        unpacked_bytes: of an archive.
        seconds: a job may take.
        waiting: jobs in the queue.
        kept_seconds: results are deleted afterwards.
    """

    file_bytes: int = 512 * MIB
    total_bytes: int = 1024 * MIB
    photos: int = 60
    pixels: int = 64_000_000
    members: int = 5_000
    unpacked_bytes: int = 2048 * MIB
    seconds: float = 900.0
    waiting: int = 20
    kept_seconds: float = 24 * 3600.0
