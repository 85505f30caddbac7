"""The files of `semgs reconstruct` agree about what is up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from semgs.data.choosing.choice import choose_named
from semgs.data.scene import Scene
from semgs.model.encode import Network
from semgs.run.output import files
from semgs.run.output.report import Provenance
from semgs.run.steps.pipeline import reconstruct
from semgs.runtime.stopwatch import Stages
from semgs.scene.upright import UpDirection, up_of


def test_the_page_in_3d_has_the_up_that_was_given(
    wall_scene: Callable[..., Scene], oracle: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Up is along x, which no camera suggests."""
    ups = []

    def page(scene, photos, *, up="auto", **options):
        ups.append(up_of(scene, up).direction.tolist())
        return real(scene, photos, up=up, **options)

    real = files.scene_page
    monkeypatch.setattr(files, "scene_page", page)
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    up = torch.tensor([1.0, 0, 0], dtype=torch.float64)
    result = replace(result, up=UpDirection(up, "as given"))
    files.write_results(tmp_path, result, Provenance("semgs 9.9", "a hat", 1, "cpu"), Stages(), page=True)
    assert (tmp_path / "scene.html").exists()
    assert ups == [[1.0, 0.0, 0.0]]
