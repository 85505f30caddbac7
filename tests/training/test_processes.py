"""Several pieces and several processes compute what one does."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from lightning_fabric import Fabric
from torch.nn.parallel import DistributedDataParallel

from semgs.data.views import Batch
from semgs.geometry.cameras import Cameras
from semgs.training.run.execution import Share
from semgs.training.state import TrainingState, descend
from semgs.training.supervision.supervision import Depth, make_supervision


def parts(batch: Batch, count: int) -> list[Batch]:
    """The scenes of a batch in equal pieces."""

    def cut(views, rows):
        cameras = Cameras(views.cameras.world_from_camera[rows], views.cameras.intrinsics[rows], views.size)
        return replace(
            views, images=views.images[rows], cameras=cameras, depth_range=views.depth_range[rows],
            labels=views.labels[rows], depths=views.depths[rows],
        )  # fmt: skip

    each = len(batch.scenes) // count
    slices = [slice(index * each, (index + 1) * each) for index in range(count)]
    return [Batch(cut(batch.context, rows), cut(batch.target, rows), batch.scenes[rows]) for rows in slices]


def test_pieces_of_a_batch_have_the_gradient_of_the_whole(network, batch, settings):
    whole, found = batch(0, scenes=4), []
    for pieces in ([whole], parts(whole, 2), parts(whole, 4)):
        state = TrainingState.begin(
            network(), make_supervision(settings), settings.learning_rate, settings.average_decay
        )
        report = descend(state, pieces, settings.clip, 1e-3)
        found.append((torch.cat([one.grad.flatten() for one in state.model.parameters()]), report))
    for gradient, report in found[1:]:
        torch.testing.assert_close(gradient, found[0][0], rtol=1e-5, atol=1e-7)
        for name in ("total", "semantic", "colour", "smoothness", "depth", "psnr", "gradient_norm"):
            assert getattr(report, name) == pytest.approx(getattr(found[0][1], name), rel=1e-5)


def test_pieces_of_a_batch_have_the_gradient_of_the_whole_by_depth(sweeping, batch, settings):
    whole, found = batch(0, scenes=4), []
    whole.context.depths[1] = 0  # a scene without depth counts as one that has nothing to say
    for pieces in ([whole], parts(whole, 2), parts(whole, 4)):
        state = TrainingState.begin(sweeping(), Depth(), settings.learning_rate, settings.average_decay)
        report = descend(state, pieces, settings.clip, 1e-3)
        learned = [one.grad.flatten() for one in state.model.parameters() if one.requires_grad]
        found.append((torch.cat(learned), report))
    for gradient, report in found[1:]:
        torch.testing.assert_close(gradient, found[0][0], rtol=1e-5, atol=1e-7)
        for name in ("total", "depth", "gradients", "distribution", "gradient_norm"):
            assert getattr(report, name) == pytest.approx(getattr(found[0][1], name), rel=1e-5)


def test_shares_take_every_scene_of_every_step_once():
    for world, accumulate in ((1, 1), (2, 1), (2, 3), (1, 12)):
        shares = [Share(rank, world, accumulate) for rank in range(world)]
        for step in (0, 7):
            taken = [k for share in shares for piece in share.pieces(step, 12) for k in piece]
            assert taken == list(range(12 * step, 12 * step + 12))


@pytest.mark.parametrize("share", [Share(0, 4), Share(0, 1, 4), Share(0, 2, 2), Share(0, 1, 0)])
def test_a_step_that_cannot_be_shared_equally_is_refused(share: Share):
    with pytest.raises(ValueError, match="a step of 6 scenes cannot be shared"):
        share.check(6)


@pytest.fixture
def ddp(monkeypatch):
    """The engine with DDP, of this process alone."""
    for name, value in (("LOCAL_RANK", "0"), ("MASTER_ADDR", "127.0.0.1"), ("MASTER_PORT", "0")):
        monkeypatch.setenv(name, value)
    fabric = Fabric(accelerator="cpu", devices=1, strategy="ddp")
    fabric.launch()
    yield fabric
    torch.distributed.destroy_process_group()


def test_processes_exchange_the_gradient_of_all_pieces_and_once(network, batch, settings, ddp):
    settings = replace(settings, clip=1e9)
    state = TrainingState.begin(network(), make_supervision(settings), 1e-3, 0.9, ddp)
    exchanged = []

    def exchange(_, bucket):
        exchanged.extend(one.clone() for one in bucket.gradients())
        done = torch.futures.Future()
        done.set_result(bucket.buffer())
        return done

    (parallel,) = (one for one in state.objective.modules() if isinstance(one, DistributedDataParallel))
    parallel.register_comm_hook(None, exchange)
    descend(state, parts(batch(0, scenes=4), 2), settings.clip, 1e-3)
    gradients = [one.grad for one in state.model.parameters()]
    assert len(exchanged) == len(gradients)
    for found, gradient in zip(*(sorted(some, key=torch.numel) for some in (exchanged, gradients)), strict=True):
        torch.testing.assert_close(found.reshape(gradient.shape), gradient)


@pytest.mark.long
@pytest.mark.parametrize("supervision", ["rendered", "depth"])
def test_two_processes_that_share_a_step_have_the_gradient_of_one(supervision: str):
    tests = Path(__file__).resolve().parents[1]
    path = os.pathsep.join([str(tests.parent), str(tests / "support")])
    told = subprocess.run(
        [sys.executable, str(tests / "support" / "two_processes.py"), supervision],
        env={**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"},
        capture_output=True, text=True, check=True, timeout=280,
    ).stdout  # fmt: skip
    found = json.loads(told.splitlines()[-1])
    assert found["world"] == 2
    assert found["double"]["gradient"] < 1e-9
    assert found["double"]["report"] < 1e-6  # averaged in float32
    assert found["single"]["gradient"] < 1e-5
    for dtype in ("double", "single"):
        assert (found[dtype]["unlabelled"], found[dtype]["moved"]) == (0, 1)
    assert found["skipped"] == 2
