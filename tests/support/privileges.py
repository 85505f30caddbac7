"""Root may read and write whatever the permissions of files say; tests of permissions give that up for a while."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

_VERSION = 0x20080522
"""Of the two structures below: `_LINUX_CAPABILITY_VERSION_3`."""


class _Header(ctypes.Structure):
    _fields_ = (("version", ctypes.c_uint32), ("pid", ctypes.c_int))


class _Sets(ctypes.Structure):
    _fields_ = (("effective", ctypes.c_uint32), ("permitted", ctypes.c_uint32), ("inheritable", ctypes.c_uint32))


@contextmanager
def permissions_hold() -> Iterator[None]:
    """Let this thread obey permissions in the block, whoever runs the tests; the test is skipped where that cannot be."""
    if os.geteuid() != 0:
        yield
        return
    if not sys.platform.startswith("linux"):
        pytest.skip("root obeys no permissions here")
    libc, header, sets = ctypes.CDLL(None), _Header(_VERSION, 0), (_Sets * 2)()
    assert libc.capget(ctypes.byref(header), sets) == 0
    before = [one.effective for one in sets]
    for one in sets:
        one.effective = 0
    assert libc.capset(ctypes.byref(header), sets) == 0
    try:
        yield
    finally:
        for one, effective in zip(sets, before, strict=True):
            one.effective = effective
        assert libc.capset(ctypes.byref(header), sets) == 0
