"""Everything that computes, on a pretended GPU that refuses what mixes devices (`pretended.py`)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from golden import fill_golden
from networks import network, preset
from posed import posed_views

from semgs.data.choosing.choice import choose
from semgs.data.demo_scene import demo_scene
from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.views import Batch, stack
from semgs.depth_maps.depth_source import DepthMaps, Meaning
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.network_method import Handling, NetworkMethod
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.frames.reading import make_inputs, read_views
from semgs.export.ply import save_ply
from semgs.model.semgs import SemGS
from semgs.run.steps.pipeline import reconstruct
from semgs.training import presets
from semgs.training.state import TrainingState, training_step
from semgs.training.supervision.supervision import make_supervision

from pretended import Pretended, pretended_device  # isort: skip

SIZE = (32, 48)
MINIATURE = {
    "channels": 16, "cnn_widths": (8, 8, 16), "candidates": 8, "cost_width": 8, "upsampled_channels": 16, "refine_width": 8,
    "refine_levels": 3, "projected_channels": 8, "colour_blocks": 2, "semantic_blocks": 2, "harmonics": 4, "paper_heads": True,
    "gaussian_stride": 2,
}  # fmt: skip
NETWORKS = {"small": lambda: preset("small_plain"), "miniature, paper_heads": lambda: network(**MINIATURE)}

pytestmark = pytest.mark.filterwarnings("ignore:Gaussians on a CUDA device are rendered on the CPU")


@pytest.fixture
def cuda() -> Iterator[torch.device]:
    with pretended_device() as device:
        yield device


@pytest.fixture(
    params=[pytest.param(NETWORKS["small"], marks=pytest.mark.long), NETWORKS["miniature, paper_heads"]],
    ids=NETWORKS.keys(),
)
def model(request, cuda: torch.device) -> SemGS:
    return fill_golden(request.param()).to(cuda)


def labelled(seed: int) -> Batch:
    generator = torch.Generator().manual_seed(seed)
    views = posed_views(3, SIZE, seed=seed)
    labels = torch.randint(0, 20, (3, *SIZE), generator=generator).to(torch.uint8)
    both = stack([replace(views, labels=labels, depths=1 + 3 * torch.rand(3, *SIZE, generator=generator))] * 2)
    return Batch(both.select([0, 1]), both.select([2]), ("a", "b"))


def test_the_pretended_device_computes_and_refuses_partners_on_the_cpu(cuda: torch.device):
    there = torch.tensor([1.0, 2.0], device=cuda)
    assert isinstance(there, Pretended)
    assert there.is_cuda
    assert (2 * there)[1].item() == 4
    with pytest.raises(RuntimeError, match="found cuda:0 and cpu"):
        there + torch.ones(2)
    with pytest.raises(TypeError, match="numpy"):
        there.numpy()
    assert not isinstance((there + torch.tensor(1.0)).cpu(), Pretended)


def test_a_network_encodes_classifies_and_renders_what_it_does_on_the_cpu(model: SemGS):
    views = posed_views(2, SIZE)
    with torch.no_grad():
        encoding, classes = model(views), model.classify(views)
        assert isinstance(encoding.gaussians.means, Pretended)
        assert isinstance(classes, Pretended)
        assert isinstance(encoding.render(views.cameras).images, Pretended)
        found = encoding.depths.cpu(), classes.cpu()
        model.to("cpu")
        torch.testing.assert_close(found, (model(views).depths, model.classify(views)), rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize(
    "supervision",
    ["rendered", *(pytest.param(name, marks=pytest.mark.long) for name in ("labels", "pictures", "depth"))],
)
def test_a_step_of_every_supervision_moves_the_weights_and_validates(model: SemGS, supervision: str):
    settings = replace(presets.small(), supervision=supervision)
    chosen = make_supervision(settings)
    state = TrainingState.begin(model, chosen, 1e-3, 0.99)
    report = training_step(state, [labelled(0)], settings)
    assert report.moved
    verdict = chosen.validate(state.average.module, [labelled(1)])
    assert math.isfinite(verdict.score)
    assert verdict.pictures is not None


def test_a_scene_is_reconstructed_and_exported(model: SemGS, tmp_path: Path):
    scene = open_scene(demo_scene())
    result = reconstruct(scene, replace(choose(scene, 2), size=SIZE), model)
    assert not isinstance(result.encoding.depths, Pretended)
    save_ply(tmp_path / "gaussians.ply", result.encoding.gaussians)
    assert (tmp_path / "gaussians.ply").stat().st_size > 0


class Flat:
    """Depth maps of a wall that faces each camera, as the networks here see it, without training."""

    title, made_by = "walls", None
    meaning: Meaning = "scaled"

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> torch.Tensor:
        return torch.ones(size)


@pytest.mark.parametrize("depth", [None, lambda scene: Flat()], ids=["", "depth maps"])
def test_a_frame_is_predicted_for_an_evaluation(model: SemGS, depth: Callable[[Scene], DepthMaps] | None):
    task = make_plan("neighbours", neighbours, [open_scene(demo_scene())], (2,), SIZE).tasks[0]
    found = NetworkMethod(model, "cuda", "ours", Handling(depth=depth)).predict(make_inputs(task, read_views(task)))
    assert found.labels.shape == SIZE
    assert not isinstance(found.image, Pretended)
