"""Training on a GPU: a step measures what it measures on the CPU, and a run goes on where it was."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_views

from semgs.data.views import Batch, stack
from semgs.model.weights.load import load
from semgs.training import presets
from semgs.training.loop import train
from semgs.training.run.execution import Execution
from semgs.training.run.run_folder import WEIGHTS
from semgs.training.state import TrainingState, training_step
from semgs.training.supervision.supervision import make_supervision

pytestmark = [pytest.mark.gpu, pytest.mark.usefixtures("real_rendering", "gsplat")]


def labelled(seed: int) -> Batch:
    generator = torch.Generator().manual_seed(seed)
    views = posed_views(3, (32, 48), seed=seed)
    labels = torch.randint(0, 20, (3, 32, 48), generator=generator).to(torch.uint8)
    depths = 1 + 3 * torch.rand(3, 32, 48, generator=generator)
    both = stack([replace(views, labels=labels, depths=depths)] * 2)
    return Batch(both.select([0, 1]), both.select([2]), ("a", "b"))


MEASURED = ("total", "semantic", "colour", "smoothness", "depth", "gradients", "distribution", "psnr")


@pytest.mark.parametrize("supervision", ["rendered", "labels", "pictures", "depth"])
def test_a_step_measures_the_same_on_both_devices_and_validates(cuda, supervision: str) -> None:
    settings = replace(presets.small_plain(), supervision=supervision)
    reports = []
    for device in ("cpu", cuda):
        chosen = make_supervision(settings)
        state = TrainingState.begin(fill_golden(preset("small_plain")).to(device), chosen, 1e-3, 0.99)
        reports.append(training_step(state, [labelled(0)], settings))
        assert chosen.validate(state.average.module, [labelled(1)]).pictures is not None
    here, there = reports
    assert there.moved
    for name in MEASURED:
        assert getattr(there, name) == pytest.approx(getattr(here, name), rel=1e-3, nan_ok=True)
    assert there.gradient_norm == pytest.approx(here.gradient_norm, rel=1e-2)


@pytest.mark.parametrize("precision", ["float32", "auto"])
def test_a_run_on_cuda_goes_on_and_leaves_weights_that_load(tmp_path: Path, precision: str) -> None:
    pytest.importorskip("embreex")
    settings = replace(
        presets.small_plain(), steps=2, batch=1, size=(32, 48), contexts=(2, 2), validate_every=2, validation_scenes=1
    )
    execution = Execution("cuda", precision=precision, workers=0, minutes=0.0)
    steps = [train(settings, tmp_path / "run", execution).step for _ in range(2)]
    assert steps == [1, 2]
    load("small_plain", tmp_path / "run" / WEIGHTS)
