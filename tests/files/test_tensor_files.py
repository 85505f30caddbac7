"""Files that are no safetensors files are said to be none, in words of ours."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from semgs.files.errors import InputError
from semgs.files.tensor_files import open_tensors, tensor_bytes


@pytest.mark.parametrize("text", [b"", b"short", b"a text that is longer than the length of a header"])
def test_another_format_is_called_so(tmp_path: Path, text: bytes):
    path = tmp_path / "file.txt"
    path.write_bytes(text)
    found = "a file of another format, or one that is cut off"
    with pytest.raises(InputError) as caught, open_tensors(path, "a scene"):
        pass
    assert str(caught.value) == f"{path}: expected a scene, found {found}"


def test_a_file_that_is_cut_off_is_called_so_and_a_complete_one_opens(tmp_path: Path):
    path = tmp_path / "a.safetensors"
    save_file({"a": torch.zeros(3)}, path)
    with open_tensors(path, "tensors") as opened:
        assert opened.get_tensor("a").shape == (3,)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(InputError, match="or one that is cut off"), open_tensors(path, "tensors"):
        pass


def test_equal_tensors_and_metadata_are_equal_bytes(tmp_path: Path):
    """Whatever the order of the metadata; the file is one of safetensors."""
    tensors, metadata = (
        {"b": torch.arange(3.0), "a": torch.ones(2, dtype=torch.bfloat16)},
        {f"key {k}": "ü" * k for k in range(9)},
    )
    data = tensor_bytes(tensors, metadata)
    assert {tensor_bytes(tensors, dict(order)) for order in (metadata.items(), reversed(metadata.items()))} == {data}
    (tmp_path / "a.safetensors").write_bytes(data)
    with open_tensors(tmp_path / "a.safetensors", "tensors") as opened:
        assert opened.metadata() == metadata
        assert all(torch.equal(opened.get_tensor(name), tensor) for name, tensor in tensors.items())
