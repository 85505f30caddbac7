"""Hashes of files, and errors that travel between processes."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

from semgs.files.contents import sha256, sha256_of
from semgs.files.errors import InputError


def test_the_hash_of_abc_is_that_of_the_standard(tmp_path: Path):
    (tmp_path / "abc").write_bytes(b"abc")
    assert sha256(tmp_path / "abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    with pytest.raises(OSError, match="absent"):
        sha256(tmp_path / "absent")


def test_the_hash_of_an_array_is_of_its_shape_type_and_numbers():
    values = np.arange(6, dtype=np.uint8).reshape(2, 3)
    others = (values.reshape(3, 2), values.astype(np.int8), values[:, ::-1], values + 1)
    assert sha256_of(values) == sha256_of(np.asfortranarray(values))
    assert len({sha256_of(values), *map(sha256_of, others)}) == 5


def test_an_input_error_comes_whole_out_of_another_process():
    error = InputError("a/b.json", "two numbers", "three", key="size", advice="leave one out")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.path, again.key, again.advice) == (str(error), Path("a/b.json"), "size", "leave one out")
