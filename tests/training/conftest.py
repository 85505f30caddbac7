"""A network, a renderer and batches so small that a step takes milliseconds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import nn

from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.data.views import Batch, Views
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.plane_sweep import depth_candidates, expected_depth
from semgs.model.layers.network_input import widen
from semgs.objectives.losses import LossWeights
from semgs.rendering.rendering import Rendering
from semgs.scene.coarse_depth import CoarseDepth
from semgs.scene.encoding import Encoding
from semgs.training.training_settings import TrainingSettings

SIZE = (16, 24)


class TinyNetwork(nn.Module):
    """A Gaussian per pixel, its colour, classes, opacity and depth from one convolution."""

    def __init__(self) -> None:
        super().__init__()
        self.classes = SCANNET20
        self.layer = nn.Conv2d(3, 3 + len(SCANNET20) + 2, 3, padding=1)

    def forward(self, views: Views) -> Encoding:
        maps = self.layer(views.images.flatten(end_dim=-4)).permute(0, 2, 3, 1)
        maps = maps.reshape(*views.images.shape[:-4], -1, maps.shape[-1])
        colour, classes, opacity, depth = maps.split((3, len(SCANNET20), 1, 1), dim=-1)
        quaternions = torch.zeros_like(maps[..., :4]) + torch.tensor([1.0, 0, 0, 0])
        scales = torch.full_like(colour, 0.01)
        depths = depth[..., 0].exp().reshape(views.images.shape[:-3] + views.size)
        return Encoding(
            gaussians=Gaussians(
                means=torch.zeros_like(colour),
                opacities=opacity[..., 0].sigmoid(),
                colour=Appearance(quaternions, scales, colour[..., None, :]),
                semantic=Appearance(quaternions, scales, classes.softmax(-1)),
            ),
            depths=depths,
            confidences=torch.ones_like(depths),
            depth_spread=torch.zeros_like(depths),
            depth_range=views.depth_range,
        )


class TinySweep(nn.Module):
    """Probabilities of eight depths for each 4x4 pixels from one convolution, which each pixel takes as they are; and a layer more."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Conv2d(3, 8, 4, stride=4)
        self.other = nn.Linear(1, 1)

    def sweep(self, views: Views) -> CoarseDepth:
        logits = self.layer(views.images.flatten(end_dim=-4))
        probabilities = logits.softmax(1).reshape(*views.images.shape[:-3], *logits.shape[1:])
        candidates = depth_candidates(views.depth_range, 8).to(logits)
        depths = expected_depth(probabilities, candidates)
        return CoarseDepth(widen(depths, 4), probabilities, candidates, "inverse")

    def depth_parameters(self) -> set[str]:
        return {"layer.weight", "layer.bias"}


def shown_as_they_lie(gaussians: Gaussians, cameras: Cameras, *, near: object = None, clamp: bool = True) -> Rendering:
    """Every camera sees the Gaussians of the context views, laid out as the pixels they come from, averaged over views."""
    height, width = cameras.size
    views = len(gaussians) // (height * width)
    count = cameras.batch[-1]

    def laid_out(values: torch.Tensor) -> torch.Tensor:
        mean = values.unflatten(-2, (views, height, width)).mean(-4).movedim(-1, -3)
        return mean[..., None, :, :, :].expand(*mean.shape[:-3], count, *mean.shape[-3:])

    alphas = laid_out(gaussians.opacities[..., None])[..., 0, :, :]
    colours = laid_out(gaussians.colour.features[..., 0, :] + 0.5)
    colours = colours.clamp(0, 1) if clamp else colours
    classes = None if gaussians.semantic is None else laid_out(gaussians.semantic.features)
    return Rendering(colours, classes, alphas * 3, alphas)


def make_batch(step: int, scenes: int = 2, contexts: int = 2, targets: int = 2) -> Batch:
    generator = torch.Generator().manual_seed(step)

    def views(count: int) -> Views:
        images = torch.rand(scenes, count, 3, *SIZE, generator=generator)
        labels = torch.randint(0, 20, (scenes, count, *SIZE), generator=generator).to(torch.uint8)
        labels[..., 0, :] = IGNORE
        pose = torch.eye(4, dtype=torch.float64)
        pose[:3, :3] = torch.tensor([[0, -1, 0], [0.6, 0, -0.8], [0.8, 0, 0.6]])
        poses = pose.repeat(scenes, count, 1, 1)
        poses[..., :3, 3] = torch.rand(scenes, count, 3, generator=generator)
        intrinsics = torch.tensor([[20.0, 0, 11.3], [0, 21.0, 8.9], [0, 0, 1]]).expand(scenes, count, 3, 3)
        depths = 1 + 3 * torch.rand(scenes, count, *SIZE, generator=generator)
        bounds = torch.tensor([0.5, 10.0]).expand(scenes, count, 2)
        return Views(images, Cameras(poses, intrinsics, SIZE), bounds, labels, depths)

    return Batch(views(contexts), views(targets), tuple(f"scene {step}/{index}" for index in range(scenes)))


@pytest.fixture
def batch() -> Callable[..., Batch]:
    """Makes the batch of a step."""
    return make_batch


@pytest.fixture
def network() -> Callable[[], TinyNetwork]:
    """Makes the tiny network, always with the same weights."""

    def make() -> TinyNetwork:
        torch.manual_seed(5)
        return TinyNetwork()

    return make


@pytest.fixture
def sweeping() -> Callable[[], TinySweep]:
    """Makes the tiny network that finds depth, always with the same weights."""

    def make() -> TinySweep:
        torch.manual_seed(5)
        return TinySweep()

    return make


@pytest.fixture(autouse=True)
def _tiny_renderer(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets the stand-in take the place of splatting, except in tests that ask for `real_rendering`."""
    if "real_rendering" not in request.fixturenames:
        monkeypatch.setattr("semgs.scene.encoding.render", shown_as_they_lie)


@pytest.fixture
def real_rendering() -> None:
    """Keeps splatting as it is."""


@pytest.fixture
def checkpoint_reads(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The steps of the checkpoints that are read from now on, once for each time."""
    steps: list[int] = []
    read = Path.read_bytes

    def counted(path: Path) -> bytes:
        if path.parent.name == "checkpoints" and path.suffix == ".safetensors":
            steps.append(int(path.stem))
        return read(path)

    monkeypatch.setattr(Path, "read_bytes", counted)
    return steps


@pytest.fixture
def settings() -> TrainingSettings:
    """A run of 12 steps."""
    return TrainingSettings(
        model="small_plain",
        steps=12,
        size=SIZE,
        learning_rate=1e-2,
        losses=LossWeights(semantic=0.5, smoothness=0.1),
        depth_weight=0.1,
        context_targets=True,
        validate_every=6,
        seed=3,
    )
