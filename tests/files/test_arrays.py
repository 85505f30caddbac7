"""Arrays in NumPy's format: what is written is read, and headers that lie are found out."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from traced_memory import most_memory

from semgs.files.arrays import read_array, read_map
from semgs.files.errors import InputError


@pytest.mark.parametrize("dtype", ["<f4", ">f8", "<u2", "i1"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_what_is_written_is_read_back(tmp_path: Path, dtype: str, order: str):
    array = np.arange(15).reshape(3, 5).astype(dtype, order=order)
    np.save(tmp_path / "a.npy", array)
    np.testing.assert_array_equal(read_array(tmp_path / "a.npy"), array)
    with (tmp_path / "b.npy").open("wb") as file:
        np.lib.format.write_array(file, array, version=(3, 0))
    np.testing.assert_array_equal(read_array(tmp_path / "b.npy"), array)


@pytest.mark.parametrize("shape", [(3, 5), (3, 5, 1), (1, 3, 5)])
@pytest.mark.parametrize("order", ["C", "F"])
def test_maps_with_one_channel_are_maps(tmp_path: Path, shape: tuple[int, ...], order: str):
    array = np.arange(15, dtype=np.float32).reshape(3, 5)
    np.save(tmp_path / "a.npy", array.reshape(shape).copy(order))
    np.testing.assert_array_equal(read_map(tmp_path / "a.npy"), array)


def test_maps_of_several_channels_stay_as_they_are(tmp_path: Path):
    np.save(tmp_path / "a.npy", np.zeros((3, 5, 2)))
    assert read_map(tmp_path / "a.npy").shape == (3, 5, 2)


def lying(shape: tuple[int, ...], dtype: str = "<f4", data: bytes = bytes(60)) -> bytes:
    """A file whose header tells of that shape, with other data behind it."""
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": dtype, "fortran_order": False, "shape": shape})
    return file.getvalue() + data


@pytest.mark.parametrize("shape", [(30000, 30000), (10**9, 10**9), (-3, -5), (3, 6), (3, 4), (2**63, 2**63)])
def test_headers_that_lie_are_found_out_before_anything_is_allocated(tmp_path: Path, shape: tuple[int, ...]):
    (tmp_path / "a.npy").write_bytes(lying(shape))
    refusal = r"a\.npy: expected an array of numbers, as long as its header says, found .* 60 bytes"

    def read() -> None:
        with pytest.raises(InputError, match=refusal):
            read_array(tmp_path / "a.npy")

    assert most_memory(read) < 1_000_000


def headed(header: bytes) -> bytes:
    """A file with a header of any text."""
    return b"\x93NUMPY\1\0" + len(header).to_bytes(2, "little") + header + bytes(60)


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '<f4', 'fortran_order': False, 'shape': (3, 5), ",  # NumPy takes it for one of Python 2, and stumbles over its end
        b"{'descr': '<f4', 'fortran_order': False, 'shape': " + b"(" * 300,
        b"{'descr': '<f4', 'fortran_order': False, 1: (3, 5)}",
        b"-" * 5000 + b"1",
        b"{'descr': '|u1', 'fortran_order': False, 'shape': (True, 60)}\n",
        b"{'descr': '|u1', 'fortran_order': False, 'shape': (0, %d)}\n" % 10**25,
    ],
)
def test_headers_that_numpy_stumbles_over_are_refused(tmp_path: Path, header: bytes):
    (tmp_path / "a.npy").write_bytes(headed(header))
    with pytest.raises(InputError, match=r"a\.npy: expected an array of numbers,"):
        read_array(tmp_path / "a.npy")


@pytest.mark.parametrize(
    "content",
    [
        b"", b"\x93NUMPY", b"\x93NUMPY\x09\x00\xff\xff{}", b"not an array", lying((3, 5))[:40],
        lying((3,), "|O", b"cos\nsystem\n(S'true'\ntR."), lying((3,), "<U5"), lying((3,), "<c8", bytes(24)),
    ],
)  # fmt: skip
def test_other_files_are_refused_and_nothing_is_unpickled(tmp_path: Path, content: bytes):
    (tmp_path / "a.npy").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.npy: expected an array of numbers"):
        read_array(tmp_path / "a.npy")
    with pytest.raises(InputError, match="No such file"):
        read_array(tmp_path / "b.npy")
