"""scripts/average_weights.py: the mean of weights, the sum of their changes, and what the header says."""

from __future__ import annotations

import json
import runpy
from pathlib import Path

import pytest
import torch
from networks import network

from semgs.data.origin.terms import FURNISHED, ROOMS, terms_text
from semgs.files.errors import InputError
from semgs.model.semgs import SemGS
from semgs.model.weights.header import DATA_TERMS, SCENES
from semgs.model.weights.load import data_terms, trained_scenes
from semgs.model.weights.weights_file import read_header, read_tensors, save

AVERAGE = runpy.run_path(str(Path(__file__).parents[3] / "scripts" / "average_weights.py"))["average"]


def of_ones(value: float) -> SemGS:
    """A network whose parameters all have one value."""
    model = network()
    with torch.no_grad():
        for one in model.parameters():
            one.fill_(value)
    return model


@pytest.mark.long
def test_a_file_that_is_named_twice_counts_twice(tmp_path: Path):
    one, other = tmp_path / "one.safetensors", tmp_path / "other.safetensors"
    save(one, of_ones(1.0), {SCENES: json.dumps(["b", "a"]), DATA_TERMS: terms_text([ROOMS]), "seed": "4"})
    save(other, of_ones(2.5), {SCENES: json.dumps(["c", "a"]), DATA_TERMS: terms_text([FURNISHED])})
    AVERAGE([one, one, other], tmp_path / "mean.safetensors")
    named = dict(of_ones(0.0).named_parameters())
    assert all(
        (tensor == 1.5).all() for name, tensor in read_tensors(tmp_path / "mean.safetensors").items() if name in named
    )
    assert trained_scenes(tmp_path / "mean.safetensors") == ("a", "b", "c")
    assert data_terms(tmp_path / "mean.safetensors") == (ROOMS, FURNISHED)
    header = read_header(tmp_path / "mean.safetensors").metadata
    assert header["description"] == "the mean of one.safetensors, one.safetensors, other.safetensors"
    assert (header["data"], header["seed"]) == ("unknown", "4, unknown")


def test_with_a_start_the_changes_of_all_files_are_added_to_it(tmp_path: Path):
    start, one, other, mean = (tmp_path / f"{name}.safetensors" for name in ("start", "one", "other", "sum"))
    for path, value in ((start, 1.0), (one, 1.5), (other, 3.0)):
        save(path, of_ones(value), {})
    AVERAGE([one, other], mean, start)
    named = dict(of_ones(0.0).named_parameters())
    assert all((tensor == 3.5).all() for name, tensor in read_tensors(mean).items() if name in named)  # 1 + 0.5 + 2
    assert read_header(mean).metadata["description"] == (
        "start.safetensors with the changes of one.safetensors, other.safetensors"
    )


def test_a_start_of_another_network_is_refused(tmp_path: Path):
    save(tmp_path / "one.safetensors", of_ones(1.0), {})
    save(tmp_path / "start.safetensors", network(channels=16), {})
    with pytest.raises(InputError, match=r"start\.safetensors: expected weights of the network and classes of one"):
        AVERAGE([tmp_path / "one.safetensors"], tmp_path / "sum.safetensors", tmp_path / "start.safetensors")
    assert not (tmp_path / "sum.safetensors").exists()


def test_other_networks_are_refused_and_nothing_is_written(tmp_path: Path):
    save(tmp_path / "one.safetensors", of_ones(1.0), {})
    save(tmp_path / "other.safetensors", network(channels=16), {})
    with pytest.raises(
        InputError, match=r"other\.safetensors: expected weights of the network and classes of one\.safetensors"
    ):
        AVERAGE([tmp_path / "one.safetensors", tmp_path / "other.safetensors"], tmp_path / "mean.safetensors")
    assert not (tmp_path / "mean.safetensors").exists()
