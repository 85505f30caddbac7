"""scripts/undo_class_weights.py: the logarithm of each class weight leaves the class's logit, and all else stays."""

from __future__ import annotations

import math
import runpy
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from golden import fill_golden

from semgs.files.errors import InputError
from semgs.model.build import build
from semgs.model.networks import small
from semgs.model.switches import switched
from semgs.model.weights.weights_file import read_header, read_tensors, save
from semgs.training import presets
from semgs.training.run.run_folder import claim_folder

UNDO = runpy.run_path(str(Path(__file__).parents[2] / "scripts" / "undo_class_weights.py"))["undo"]


def test_a_class_that_counted_twice_loses_ln_2_to_all_others(tmp_path: Path):
    settings = replace(presets.small(), class_weights=(1.0, 2.0, *18 * (1.0,)))
    claim_folder(tmp_path / "run", settings)
    header = {
        "data": "none",
        "description": "old",
        "scores": "[]",
        "temperatures": '{"rendered": 1.5, "gaussians": 2.0}',
    }
    save(tmp_path / "old.safetensors", fill_golden(build(small())), header, torch.float32)
    UNDO(tmp_path / "old.safetensors", tmp_path / "run", tmp_path / "new.safetensors")
    old, new = (read_tensors(tmp_path / f"{name}.safetensors") for name in ("old", "new"))
    own = "semantic.refinement.classifier.bias"
    change = new.pop(own).float() - old.pop(own).float()
    assert (change[0] - change[1]).item() == pytest.approx(math.log(2), abs=0.01)
    assert (change[2:] - change[0]).abs().max() < 0.01
    assert all(torch.equal(new[name].float(), tensor.bfloat16().float()) for name, tensor in old.items())
    assert read_header(tmp_path / "new.safetensors").metadata == {
        "data": "none", "description": "old; without the class weights of run",
    }  # fmt: skip


def test_a_mean_of_two_networks_is_refused(tmp_path: Path):
    claim_folder(tmp_path / "run", replace(presets.small(), class_weights=(1.0, 2.0, *18 * (1.0,))))
    save(tmp_path / "old.safetensors", build(switched(small(), {"class_mosaic": True})), {})
    with pytest.raises(InputError, match="weights without MOSAIC"):
        UNDO(tmp_path / "old.safetensors", tmp_path / "run", tmp_path / "new.safetensors")


def test_a_class_that_did_not_count_cannot_be_given_back(tmp_path: Path):
    claim_folder(tmp_path / "run", replace(presets.small(), class_weights=(0.0, *19 * (1.0,))))
    save(tmp_path / "old.safetensors", fill_golden(build(small())), {})
    with pytest.raises(InputError, match="expected class weights above 0"):
        UNDO(tmp_path / "old.safetensors", tmp_path / "run", tmp_path / "new.safetensors")
    assert not (tmp_path / "new.safetensors").exists()


def test_a_training_that_weighted_no_class_is_refused(tmp_path: Path):
    claim_folder(tmp_path / "run", presets.small())
    save(tmp_path / "old.safetensors", fill_golden(build(small())), {})
    with pytest.raises(InputError, match="--class-weights"):
        UNDO(tmp_path / "old.safetensors", tmp_path / "run", tmp_path / "new.safetensors")
