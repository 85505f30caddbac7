"""Run folders and settings."""

from __future__ import annotations

from dataclasses import replace

import pytest

from semgs.files.errors import InputError
from semgs.rooms import demo
from semgs.training.presets import PRESETS
from semgs.training.run import claim, export_weights, read_settings
from semgs.training.settings import VALIDATION_SEED, TrainingSettings, differences


@pytest.mark.parametrize("name", PRESETS)
def test_settings_survive_json(name: str, tmp_path):
    settings = replace(PRESETS[name](), class_weights=(1.0,) * 20)
    claim(tmp_path / "run", settings)
    assert read_settings(tmp_path / "run") == settings


def test_a_run_of_other_settings_is_refused_with_the_difference(settings, tmp_path):
    claim(tmp_path, settings)
    claim(tmp_path, settings)
    with pytest.raises(ValueError, match=r"steps = 12 there, 13 asked"):
        claim(tmp_path, replace(settings, steps=13))


def test_a_folder_of_something_else_is_refused(settings, tmp_path):
    (tmp_path / "thesis.tex").write_text("mine")
    with pytest.raises(InputError, match="something else"):
        claim(tmp_path, settings)
    with pytest.raises(InputError, match="no such file"):
        read_settings(tmp_path)


def test_a_start_that_was_killed_at_once_does_not_block_the_next(settings, tmp_path):
    (tmp_path / ".settings.json.1a2b3c4d.part").write_text("{")
    claim(tmp_path, settings)
    assert read_settings(tmp_path) == settings


def test_a_run_without_a_checkpoint_has_no_weights(settings, tmp_path):
    claim(tmp_path, settings)
    with pytest.raises(InputError, match="train first"):
        export_weights(tmp_path, tmp_path / "weights.safetensors")


def test_unknown_fields_of_a_newer_version_are_named(settings):
    with pytest.raises(ValueError, match="hold curriculum"):
        TrainingSettings.from_json({**settings.as_json(), "curriculum": True})


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("seed", VALIDATION_SEED),
        ("seed", demo.SEED),
        ("seed", -1),
        ("steps", 0),
        ("contexts", (1, 2)),
        ("contexts", (4, 2)),
        ("warmup", 0.0),
        ("size", (8, 320)),
    ],
)
def test_settings_that_cannot_be_are_refused_by_name(settings, field: str, value: object):
    with pytest.raises(ValueError, match=f"{field} is"):
        replace(settings, **{field: value})


def test_differences_name_both_values(settings):
    assert differences(replace(settings, batch=5), settings) == {"batch": (5, 2)}
