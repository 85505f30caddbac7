"""Infinigen itself, where its environment is or can be made: a cheap piece, twice the same."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

pytest.importorskip("embreex")

from semgs.files.errors import InputError
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.furniture import environment
from semgs_rooms.furniture.generation import generate, record_of
from semgs_rooms.furniture.kinds import make_job

SEED = next(seed for seed in range(1000) if make_job(seed, 0).kind == "desk")


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_infinigen_makes_a_desk_and_again_the_same(tmp_path: Path) -> None:
    named = os.environ.get("SEMGS_INFINIGEN")
    folder = Path(named) if named else environment.default_folder()
    try:
        environment.prepare(folder)
    except InputError as error:
        pytest.skip(f"Infinigen's environment cannot be made: {error}")
    for name in ("one", "two"):
        generate(tmp_path / name, SEED, 1, environment=folder)
    record = record_of(tmp_path / "one", make_job(SEED, 0))
    assert record.read_bytes() == record_of(tmp_path / "two", make_job(SEED, 0)).read_bytes()
    (row,) = Library(tmp_path / "one").meshes
    assert row.label == "desk"
    (file,) = (tmp_path / "one" / "models").iterdir()
    assert file.read_bytes() == (tmp_path / "two" / "models" / file.name).read_bytes()
