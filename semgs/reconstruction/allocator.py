"""The allocator of the C library, set for a process that computes: memory that is freed is kept for what comes next.

Every frame and every training step takes and frees the same hundreds of megabytes. The GNU C library gives them back to the system
each time the end of its heap is free, and the system hands them out again page by page, zeroed: a tenth of the time of a frame.
"""

from __future__ import annotations

import ctypes

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Numbers of the two parameters in `malloc.h`."""

NEVER = 2**31 - 1
"""The largest number of bytes that the first of them takes."""

LARGE = 32 * 2**20
"""From here on a block for which nothing that is kept has room comes from the system and goes back to it, so that it leaves no hole
[bytes]. The library goes as far by itself, but not where another of its parameters was set."""


def keep_freed_memory() -> bool:
    """Let this process keep the memory of blocks under `LARGE` that it frees; whether the C library here can.

    It holds for all of the process, so this is for programs and not for imports: the command `semgs` calls it when it
    starts. What is freed counts as held until the process ends, at most what it needed at its fullest moment.
    """
    try:
        set_parameter = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # other C libraries, and Windows
        return False
    return bool(set_parameter(MMAP_THRESHOLD, LARGE) and set_parameter(TRIM_THRESHOLD, NEVER))
