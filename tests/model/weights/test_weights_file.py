"""The weights file."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from semgs.files.errors import InputError
from semgs.model.weights.weights_file import read_header


@pytest.mark.parametrize("version", ["1", "3", ""])
def test_another_format_is_refused(tmp_path: Path, version: str):
    path = tmp_path / "other.safetensors"
    save_file({"x": torch.zeros(1)}, path, {"semgs": version, "settings": "{}", "classes": "null"})
    with pytest.raises(InputError, match="weights of format 2, written by semgs"):
        read_header(path)
