"""scripts/gpu_day.sh and gpu_ablation.sh: short trainings on the CPU by the commands for a GPU."""

from __future__ import annotations

import os
import subprocess
import sys
import time
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


def stand_in(path: Path, program: str) -> Path:
    """A program to run in place of Python, in bash."""
    path.write_text(f"#!/usr/bin/env bash\n{program}\n")
    path.chmod(0o755)
    return path


@pytest.mark.skipif(sys.platform == "win32", reason="a bash script")
def test_if_depth_fails_the_training_of_classes_beside_it_is_told_to_end(tmp_path: Path) -> None:
    ended, started = tmp_path / "ended", tmp_path / "started"
    python = stand_in(
        tmp_path / "python",
        f"""case "$*" in
        *"--out {tmp_path}/out/classes "*) trap 'touch {ended}; exit 0' TERM; touch {started}; for _ in {{1..600}}; do sleep 0.1; done ;;
        *) while [ ! -e {started} ]; do sleep 0.1; done; exit 5 ;;
        esac""",
    )
    command = ["bash", ROOT / "scripts/gpu_day.sh", tmp_path / "out", tmp_path / "rooms", tmp_path / "photos"]
    assert subprocess.run(command, env=os.environ | {"PYTHON": str(python)}, check=False).returncode == 5
    until = time.monotonic() + 20
    while not ended.exists() and time.monotonic() < until:
        time.sleep(0.1)
    assert ended.exists()


@pytest.mark.skipif(sys.platform == "win32", reason="a bash script")
def test_an_ablation_waits_for_all_rows_and_ends_with_the_code_of_one_that_failed(tmp_path: Path) -> None:
    python = stand_in(
        tmp_path / "python",
        f"""case "$*" in
        *"--rows none "*) exit 5 ;;
        *"--rows full "*) sleep 1; touch {tmp_path}/full ;;
        esac""",
    )
    environment = os.environ | {"PYTHON": str(python), "SEEDS": "1", "ROWS": "none full"}
    command = ["bash", ROOT / "scripts/gpu_ablation.sh", tmp_path / "out"]
    assert subprocess.run(command, env=environment, check=False).returncode == 5
    assert (tmp_path / "full").exists()


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
