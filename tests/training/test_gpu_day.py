"""scripts/gpu_day.sh and gpu_ablation.sh: short trainings on the CPU by the commands for a GPU."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from image_sets import random_numbers, write_image_set

from semgs.model.weights.load import load
from semgs.model.weights.weights_file import read_tensors

ROOT = Path(__file__).resolve().parents[2]
STEPS = {"CLASSES": "2", "DEPTH": "2", "COLOUR": "2", "SIZE": "48x64", "CROP": "48x64", "BATCH": "2", "WORKERS": "0"}


@pytest.mark.long
def test_a_day_on_a_gpu_in_miniature_moves_classes_depth_and_colour(tmp_path: Path) -> None:
    pytest.importorskip("embreex")
    rooms = [sys.executable, "-m", "semgs", "rooms", tmp_path / "rooms", "--scenes", "2", "--frames", "3"]
    subprocess.run([*rooms, "--size", "48x64", "--workers", "0"], cwd=ROOT, check=True)
    photos = write_image_set(tmp_path / "photos", {name: random_numbers(k, (60, 80)) for k, name in enumerate("ab")})
    environment = os.environ | STEPS | {"DEVICE": "cpu", "PYTHON": sys.executable}
    command = ["bash", ROOT / "scripts/gpu_day.sh", tmp_path / "out", tmp_path / "rooms", photos]
    subprocess.run(command, env=environment, check=True)

    before, after = load("small").state_dict(), read_tensors(tmp_path / "out/weights.safetensors")
    moved = {name for name in before if not torch.equal(before[name].bfloat16().float(), after[name].float())}
    for part in ("semantic.refinement.", "cnn.", "colour.depth.", "colour.heads.convex.", "colour.heads.colour."):
        assert any(name.startswith(part) for name in moved), part
    assert not any(name.startswith("semantic.transformer.") for name in moved)


@pytest.mark.long
@pytest.mark.timeout(1500)
def test_the_ablation_on_a_gpu_in_miniature_trains_all_rows_of_all_seeds_on_one_base(tmp_path: Path) -> None:
    pytest.importorskip("embreex")
    environment = os.environ | {
        "DEVICE": "cpu", "STEPS": "4", "BATCH": "1", "ROOMS": "2", "SIZE": "32x48", "SEEDS": "1 2",
        "WORKERS": "0", "VALIDATED": "0", "PYTHON": sys.executable,
    }  # fmt: skip
    command = ["bash", ROOT / "scripts/gpu_ablation.sh", tmp_path / "out"]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    assert len(list(tmp_path.glob("out/seed_[12]/*/run/weights.safetensors"))) == 14
    assert len(list(tmp_path.glob("out/base/*/weights.safetensors"))) == 2
    assert list(tmp_path.glob("out/seed_*/*/evaluation*")) == []
    assert done.stdout.split()[-3:] == ["--seeds", "1", "2"]
