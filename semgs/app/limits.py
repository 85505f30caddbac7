"""What the app accepts, and for how long it works and keeps results."""

from __future__ import annotations

import math
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
        memory_bytes: a job may take; if less is free when it starts, nine tenths of that.
        disk_bytes: a job may write.
        waiting: jobs in the queue.
        uploads, uploads_bytes: number and size of all uploaded files that no job has yet; beyond them, new ones are refused. Files of jobs in the queue may have that size once more.
        rooms_bytes: of all results and the uploads kept with them; beyond them, uploads are deleted first, then results, the oldest first.
        kept_seconds: results are deleted afterwards.
        uploads_kept_seconds: uploads of a result are deleted afterwards, or with it; until then, it can be made again.
    """

    file_bytes: int = 512 * MIB
    total_bytes: int = 1024 * MIB
    photos: int = 60
    pixels: int = 64_000_000
    members: int = 5_000
    unpacked_bytes: int = 2048 * MIB
    seconds: float = 900.0
    memory_bytes: int = 16 * 1024 * MIB
    disk_bytes: int = 8192 * MIB
    waiting: int = 20
    uploads: int = 1_000
    uploads_bytes: int = 4096 * MIB
    rooms_bytes: int = 20 * 1024 * MIB
    kept_seconds: float = 24 * 3600.0
    uploads_kept_seconds: float = 3600.0

    @property
    def kept(self) -> str:
        """How long results are kept, in words: "a day", "36 hours", "30 minutes"."""
        return _in_words(self.kept_seconds)

    @property
    def uploads_kept(self) -> str:
        """How long uploads of a result are kept, in words."""
        return _in_words(min(self.uploads_kept_seconds, self.kept_seconds))


def _in_words(seconds: float) -> str:
    """A time in the largest unit that fits."""
    if math.isinf(seconds):
        return "an unlimited time"
    minutes = max(1, round(seconds / 60))
    units = (("day", "a", 24 * 60), ("hour", "an", 60), ("minute", "a", 1))
    unit, article, length = next(one for one in units if minutes % one[2] == 0)
    count = minutes // length
    return f"{article} {unit}" if count == 1 else f"{count} {unit}s"
