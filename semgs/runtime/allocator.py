"""Tells the allocator of the C library to keep freed memory for reuse.

Every frame and every training step allocates and frees the same hundreds of megabytes. By default, the GNU C library returns them to the
system, which later hands them out again page by page, zeroed. That takes a tenth of the time of a frame.
"""

from __future__ import annotations

import ctypes

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Numbers of the two parameters in `malloc.h`."""

NEVER = 2**31 - 1
"""The largest value for the first parameter [bytes]."""

LARGE = 32 * 2**20
"""Blocks of this size and more are taken from the system and returned to it if no kept memory fits, so they leave no holes [bytes].
This is also the largest threshold that the library reaches by itself, but not if another parameter was set."""


def keep_freed_memory() -> bool:
    """Let this process keep the memory of freed blocks under `LARGE`. Returns whether the C library supports this.

    It affects the whole process, so programs call it, not imports: the command `semgs` does when it starts. Freed memory
    counts as used until the process ends, up to the peak.
    """
    try:
        set_parameter = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError, TypeError):  # other C libraries, and Windows
        return False
    return bool(set_parameter(MMAP_THRESHOLD, LARGE) and set_parameter(TRIM_THRESHOLD, NEVER))
