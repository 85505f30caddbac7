"""`scripts/refit_shapes.py`: a head without a transformer learns the shapes of one that has it, and all else stays."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from golden import fill_golden

from semgs import load
from semgs.model.build import build
from semgs.model.networks import small
from semgs.model.switches import switched
from semgs.model.weights.weights_file import save
from semgs.rooms.sets.dataset import RoomSettings, write_dataset

SCRIPT = Path(__file__).parents[2] / "scripts/refit_shapes.py"


@pytest.mark.long
def test_the_head_learns_the_shapes_and_all_else_stays(tmp_path: Path) -> None:
    write_dataset(tmp_path / "rooms", RoomSettings(77, (240, 320), 3), 3)
    old = fill_golden(build(switched(small(), {"semantic_transformer": True})))
    save(tmp_path / "old.safetensors", old, {"data": "none"}, torch.float32)
    command = [sys.executable, SCRIPT, tmp_path / "old.safetensors", tmp_path / "new.safetensors", tmp_path / "rooms"]
    run = subprocess.run([*command, "--steps", "10", "--held-out", "1"], capture_output=True, text=True, check=True)
    before, after = (
        sum(map(float, re.findall(r"0\.\d+", line))) for line in re.findall("(?:before|after):.*", run.stdout)
    )
    assert 0 < after < before
    new = load(str(tmp_path / "new.safetensors"))
    assert not new.settings.semantic.compares_views
    learned = ("semantic.upsampler.", "semantic.head.")
    before_it = old.state_dict()
    for name, tensor in new.state_dict().items():
        classes = name.startswith("semantic.head.2.")
        if not name.startswith(learned) or classes:
            kept, given = (tensor[7:], before_it[name][7:]) if classes else (tensor, before_it[name])
            assert torch.allclose(kept.double(), given.double(), rtol=2**-8, atol=1e-6), name
