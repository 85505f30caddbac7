"""One way from views to Gaussians, for reconstruction and evaluation alike."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from semgs.cli.main import main
from semgs.data.scene import Scene
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.network_method import NetworkMethod
from semgs.evaluation.frames.protocols import TargetSample
from semgs.evaluation.frames.reading import make_inputs, read_views
from semgs.model.encode import Network, encode
from semgs.model.layers.network_input import Chunks
from semgs.model.memory import memory_plan as planning
from semgs.model.weights.load import load


def task_of(scene: Scene) -> Task:
    """The second frame of a scene from the first and the last."""
    return Task(scene, (32, 48), TargetSample((0, 3), 1))


def test_an_evaluation_takes_as_few_views_at_a_time_as_memory_asks_for(
    wall_scene: Callable[..., Scene], monkeypatch: pytest.MonkeyPatch
) -> None:
    task, model = task_of(wall_scene()), load("small").eval()
    inputs = make_inputs(task, read_views(task))
    whole = NetworkMethod(model, "cpu", "small").predict(inputs)
    few = planning.MemoryPlan(1e9, "heads", Chunks(1, 1), True, 1e9)
    monkeypatch.setattr("semgs.model.semgs.SemGS.memory_plan", lambda *_: few)
    chunks: list[object] = []
    hook = model.register_forward_pre_hook(lambda _, arguments: chunks.append(arguments[1]))
    parts = NetworkMethod(model, "cpu", "small").predict(inputs)
    hook.remove()
    assert chunks == [Chunks(1, 1)]
    assert whole.depths is not None
    torch.testing.assert_close(parts.depths, whole.depths, rtol=1e-4, atol=0)
    assert parts.seconds_encode is not None
    assert parts.seconds_encode > 0


def test_an_encoding_has_no_gradient_and_is_in_float32_on_the_cpu(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    views = wall_scene().read([0, 3]).map(lambda maps: maps, images=lambda images: images.double().requires_grad_())
    found = encode(oracle, views)
    assert found.plan is None
    assert found.encoding.gaussians.colour.features.dtype == torch.float32
    assert not found.encoding.gaussians.colour.features.requires_grad
    assert found.encoding.depth_range.dtype == torch.float64
    assert encode(oracle, views, device=None).encoding.gaussians.colour.features.dtype == torch.float64


def test_an_evaluation_that_does_not_fit_ends_with_one_line_and_code_2(
    wall_scene: Callable[..., Scene],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.setattr(planning, "free_bytes", lambda: 0.0)
    monkeypatch.setattr(planning, "kept_bytes", lambda: 0.0)  # what earlier tests left would be enough
    out = tmp_path / "out"
    assert main(["evaluate", "small", "--data", str(wall_scene().path), "--views", "2", "--out", str(out)]) == 2
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.startswith("semgs: error: N = 2 at 240x320 needs about ")
    assert not out.exists()
