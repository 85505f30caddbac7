"""The weights file."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from golden import fill_golden
from networks import preset
from safetensors.torch import save_file

from semgs.files.errors import InputError
from semgs.model.weights.weights_file import read_header, restate, save


@pytest.mark.parametrize("version", ["1", "3", ""])
def test_another_format_is_refused(tmp_path: Path, version: str):
    path = tmp_path / "other.safetensors"
    save_file({"x": torch.zeros(1)}, path, {"semgs": version, "settings": "{}", "classes": "null"})
    with pytest.raises(InputError, match="weights of format 2, written by semgs"):
        read_header(path)


def test_equal_networks_are_equal_files(tmp_path: Path):
    """So the SHA-256 of a file says whether two trainings are the same."""
    network = fill_golden(preset("small_plain"))
    provenance = {name: name.upper() for name in ("seed", "steps", "licence", "data", "author", "made with")}
    save(tmp_path / "a.safetensors", network, provenance)
    save(tmp_path / "b.safetensors", network, dict(reversed(provenance.items())))
    restate(tmp_path / "a.safetensors", tmp_path / "c.safetensors", provenance)
    assert len({(tmp_path / f"{name}.safetensors").read_bytes() for name in "abc"}) == 1
