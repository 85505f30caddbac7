"""A stand-in for the environment of Infinigen: a folder whose `python` is a program of the tests."""

from __future__ import annotations

import importlib.util
import json
import os
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from asset_folders import asset_folder

from semgs_rooms.furniture import environment
from semgs_rooms.furniture.kinds import KINDS, Make
from semgs_rooms.furniture.raw import RawMesh

__all__ = ["asset_folder", "stand_in"]

PROGRAM = Path(__file__).with_name("stand_in.py")


def usual(kind: str) -> list[float]:
    """Size of a usual piece in Infinigen's frame: depth, width, height where its front is +x."""
    one = KINDS[kind]
    width, depth, height = (np.array(one.low) + one.high) / 2
    return [depth, width, height] if one.turned else [width, depth, height]


def made(make: Make, size: list[float], way: str = "") -> RawMesh:
    """What the stand-in makes, without its process."""
    spec = importlib.util.spec_from_file_location("stand_in", PROGRAM)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    arrays = module.make({"picture": make.picture, "seed": make.seed}, size, way)
    names = tuple(str(name) for name in arrays["materials"])
    return RawMesh(arrays["vertices"], arrays["faces"], arrays["uv"], arrays["material"], names, arrays["picture"])


@pytest.fixture(scope="session")
def piece():
    return made


@pytest.fixture(scope="session")
def usual_size():
    return usual


@dataclass
class StandIn:
    """The environment's folder, and what its program shall do."""

    folder: Path
    monkeypatch: pytest.MonkeyPatch

    @property
    def python(self) -> Path:
        return environment.python_of(self.folder)

    @property
    def calls(self) -> list[str]:
        """Names of the pieces that were asked for, in order."""
        path = self.folder / "calls"
        return path.read_text().split() if path.exists() else []

    def goes_wrong(self, **ways: str) -> None:
        """By the name of a piece: stray, hanging, wrong, pickle, broken, crash, slow or error."""
        told = {"sizes": {kind: usual(kind) for kind in KINDS}, "ways": ways, "calls": str(self.folder / "calls")}
        self.monkeypatch.setenv("STAND_IN", json.dumps(told))


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> StandIn:
    """An environment that is ready, in which nothing goes wrong."""
    folder = tmp_path / "environment"
    (folder / "bin").mkdir(parents=True)
    program = folder / "bin" / "python"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" "{PROGRAM}" "$@"\n')
    program.chmod(0o755)
    (folder / environment.MARK).write_text("")
    (folder / environment.STAMP).write_text(environment._pins())
    found = StandIn(folder, monkeypatch)
    found.goes_wrong()
    return found


if os.name == "nt":
    collect_ignore_glob = ["test_*.py"]
