"""Temperatures in the header of a file of weights."""

from pathlib import Path

import pytest

from semgs.files.errors import InputError
from semgs.model.weights.header import TEMPERATURES as KEY
from semgs.model.weights.header import temperatures_text
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import read_temperatures, save
from semgs.rendering.temperatures import Temperatures


def written(folder: Path, text: str | None) -> Path:
    path = folder / "own.safetensors"
    save(path, load("small", "random"), {} if text is None else {KEY: text})
    return path


def test_what_is_written_is_read_and_the_network_carries_it(tmp_path: Path):
    path = written(tmp_path, temperatures_text(Temperatures(1.5, 2.25)))
    assert read_temperatures(path) == Temperatures(rendered=1.5, gaussians=2.25)
    assert load("small", path).temperatures == Temperatures(1.5, 2.25)


def test_weights_may_have_none(tmp_path: Path):
    path = written(tmp_path, None)
    assert read_temperatures(path) is None
    assert load("small", path).temperatures is None


@pytest.mark.parametrize(
    "text", ["{", "[]", '{"rendered": 1}', '{"rendered": 1, "gaussians": 0}', '{"rendered": "x", "gaussians": 1}']
)
def test_a_header_that_makes_no_sense_is_named(tmp_path: Path, text: str):
    with pytest.raises(InputError, match=KEY):
        read_temperatures(written(tmp_path, text))
