"""The settings of a network, and their JSON."""

from __future__ import annotations

import json

import pytest
from networks import network

from semgs.model import networks
from semgs.model.settings import NetworkSettings


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
