"""What Git LFS leaves in place of a file that it has not fetched is called so, whatever the file should be."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from semgs.data.layouts.parts.sparse_points import read_ply_points
from semgs.files.arrays import read_array
from semgs.files.contents import read_bytes, read_text
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_header, read_optics, read_rgb, read_uint16
from semgs.files.tensor_files import open_tensors
from semgs.model.weights.load import load
from semgs.splats.load import load_splat

POINTER = (
    b"version https://git-lfs.github.com/spec/v1\n"
    b"oid sha256:4d7a214614ab2935c943f9e0ff69d22eadbb8f32b1258daaa5e2ca24d17e2393\nsize 12345\n"
)


def tensors(path: Path) -> None:
    with open_tensors(path, "a scene"):
        pass


@pytest.mark.parametrize(
    ("name", "read", "expected"),
    [
        ("a.jpg", read_header, "a JPEG or PNG image"),
        ("a.jpg", read_optics, "a JPEG or PNG image"),
        ("a.jpg", read_rgb, "an image"),
        ("a.png", read_uint16, "an image"),
        ("a.pgm", read_uint16, "an image"),
        ("a.npy", read_array, "an array of numbers"),
        ("a.ply", read_ply_points, "sparse points"),
        ("a.ply", load_splat, "a splat: PLY, compressed PLY, SPZ, or glTF with KHR_gaussian_splatting"),
        ("a.safetensors", tensors, "a scene"),
        ("a.json", read_text, "a text file in UTF-8"),
    ],
)
def test_a_pointer_of_git_lfs_is_called_so(tmp_path: Path, name: str, read: Callable[[Path], object], expected: str):
    path = tmp_path / name
    path.write_bytes(POINTER)
    with pytest.raises(InputError) as caught:
        read(path)
    assert str(caught.value) == (
        f"{path}: expected {expected}, found a Git LFS pointer, not the file; run git lfs pull"
    )


@pytest.mark.parametrize("name", ["a.safetensors", "a.ckpt"])
def test_weights_that_are_a_pointer_are_called_so(tmp_path: Path, name: str):
    (tmp_path / name).write_bytes(POINTER)
    with pytest.raises(
        InputError, match=rf"{name}: expected .*, found a Git LFS pointer, not the file; run git lfs pull"
    ):
        load("small", tmp_path / name)


def test_other_texts_are_read(tmp_path: Path):
    text = b"see version https://git-lfs.github.com/spec/v1"
    (tmp_path / "a.txt").write_bytes(text)
    assert read_bytes(tmp_path / "a.txt") == text
