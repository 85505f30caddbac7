"""Weights of format 1 keep loading: headers of the files that shipped before the network was composed of parts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from networks import BASE, network, preset
from safetensors.torch import save_file

from semgs.data.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.model import networks
from semgs.model.build import build
from semgs.model.settings import NetworkSettings, PaperHeads, Pyramid
from semgs.weights.file import read_header, read_tensors, save
from semgs.weights.format1 import PREFIXES, todays_name, todays_settings
from semgs.weights.load import load

HISTORY = json.loads((Path(__file__).parent / "format1.json").read_text())
"""Settings of every file that shipped, and the names and shapes of its tensors."""


def shapes(index: int) -> dict[str, tuple[int, ...]]:
    pairs = (entry.split(":") for entry in HISTORY["tensors"][index].split(" "))
    return {name: tuple(int(side) for side in text.split("x") if side) for name, text in pairs}


def test_the_history_has_three_shapes_of_settings():
    assert sorted({len(one["settings"]) for one in HISTORY["files"]}) == [32, 34, 35]
    assert len(HISTORY["files"]) == 7


@pytest.mark.parametrize("file", HISTORY["files"], ids=lambda file: file["commit"])
def test_every_file_that_shipped_fills_the_network_of_its_header(file: dict):
    with torch.device("meta"):
        model = build(todays_settings(file["settings"]), SCANNET20)
    found = {name: tuple(tensor.shape) for name, tensor in model.state_dict().items()}
    assert found == {todays_name(name): shape for name, shape in shapes(file["tensors"]).items()}
    assert model.name == "small"


def test_flat_settings_mean_what_they_did():
    assert todays_settings(BASE) == networks.base()
    assert todays_settings(BASE, semantic=False).semantic is None
    switched = {
        "paper_heads": True,
        "opacity_hidden": 5,
        "shared_layers": False,
        "semantic_pyramid": [16, 24],
        "windows": 1,
    }
    settings = todays_settings(BASE | switched)
    assert settings.colour.heads == PaperHeads(opacity_hidden=5)
    assert settings.semantic.own_cnn
    assert settings.semantic.refinement == Pyramid((16, 24))
    assert (settings.colour.transformer.windows, settings.semantic.transformer.windows) == (1, 1)


@pytest.mark.parametrize("missing", ["channels", "conventions", "harmonics"])
def test_flat_settings_that_lack_one_are_refused(missing: str):
    with pytest.raises(KeyError, match=missing):
        todays_settings({key: value for key, value in BASE.items() if key != missing})


def test_a_file_of_format_1_loads_to_the_bit(tmp_path: Path):
    path = tmp_path / "old.safetensors"
    model = preset("small", semantic_pyramid=(16, 24), shared_layers=False)
    first = {today: old for old, today in PREFIXES.items()}
    old = {
        next((first[one] + name.removeprefix(one) for one in first if name.startswith(one)), name): tensor.contiguous()
        for name, tensor in model.state_dict().items()
    }
    assert {
        "semantic_head.2.bias",
        "colour_transformer.layers.0.self_attn.merge.weight",
        "cost_regressor.head.0.bias",
    } <= set(old)
    small = {
        **BASE, "name": "small", "channels": 48, "cnn_widths": [16, 32, 48], "candidates": 64, "colour_blocks": 3,
        "semantic_blocks": 2, "expansion": 2, "reduction": 2, "cost_width": 32, "cost_hidden": 32, "upsampled_channels": 32,
        "projected_channels": 16, "refine_width": 16, "refine_levels": 4, "decoder_blocks": 1, "colour_hidden": 32,
        "semantic_hidden": 32, "last_kernel": 1, "harmonics": 4, "colour_from_image": True, "gaussian_stride": 2,
        "cosine_cost": True, "cost_prior": True, "initial_sigma": 0.5, "initial_depth_scale": 0.1,
        "semantic_pyramid": [16, 24], "shared_layers": False,
    }  # fmt: skip
    table = {
        "name": SCANNET20.name,
        "names": SCANNET20.names,
        "colours": SCANNET20.colours,
        "raw_ids": SCANNET20.raw_ids,
    }
    save_file(old, path, {"semgs": "1", "settings": json.dumps(small), "classes": json.dumps(table), "seed": "4"})
    again = load("small", path)
    assert again.settings == model.settings
    assert all(torch.equal(tensor, again.state_dict()[name]) for name, tensor in model.state_dict().items())
    save(tmp_path / "new.safetensors", again, {})
    assert read_header(tmp_path / "new.safetensors").settings == model.settings
    assert read_tensors(tmp_path / "new.safetensors").keys() == read_tensors(path).keys()


def test_a_later_format_is_refused(tmp_path: Path):
    save_file(
        {"x": torch.zeros(1)}, tmp_path / "later.safetensors", {"semgs": "3", "settings": "{}", "classes": "null"}
    )
    with pytest.raises(InputError, match="weights of format 2, written by semgs"):
        read_header(tmp_path / "later.safetensors")


@pytest.mark.parametrize("name", networks.NAMES)
def test_settings_survive_json(name: str):
    settings = networks.NETWORKS[name]()
    assert NetworkSettings.from_json(json.loads(json.dumps(settings.as_json()))) == settings


def test_settings_of_an_unknown_kind_are_refused():
    saved = networks.base().as_json()
    saved["colour"]["heads"]["kind"] = "other"
    with pytest.raises(ValueError, match="kind is 'other'; expected mvsplat or paper"):
        NetworkSettings.from_json(saved)


def test_the_test_networks_are_the_presets():
    assert network().settings == networks.base()
