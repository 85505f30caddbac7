"""What splat-transform makes of our PLY is the same scene when we read it back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from node_tools import splat_transform

import semgs
from semgs.data.demo_scene import demo_scene
from semgs.export.ply import save_ply
from semgs.geometry.gaussians import Appearance, Gaussians, move_gaussians
from semgs.geometry.rotations import covariance
from semgs.objectives.metrics import psnr
from semgs.splats.load import load_splat

pytestmark = pytest.mark.long

COUNT = 700
"""More than two chunks of a compressed PLY."""

HALF_TURN = torch.diag(torch.tensor([-1.0, -1, 1, 1], dtype=torch.float64))
"""From the PLY's axes to glTF's, about z, as splat-transform does."""

FORMATS = {"a.spz": "SPZ", "a.compressed.ply": "compressed PLY", "a.glb": "glTF", "b.ply": "PLY"}


def some_splat() -> Gaussians:
    draw = torch.Generator().manual_seed(1)
    quaternions = torch.nn.functional.normalize(torch.randn(COUNT, 4, generator=draw), dim=-1)
    scales = 0.01 + 0.1 * torch.rand(COUNT, 3, generator=draw)
    colour = Appearance(quaternions, scales, 0.2 * torch.randn(COUNT, 16, 3, generator=draw))
    opacities = 0.05 + 0.9 * torch.rand(COUNT, generator=draw)
    return Gaussians(torch.randn(COUNT, 3, generator=draw), opacities, colour)


@pytest.mark.parametrize(("name", "options"), [*((name, ()) for name in FORMATS), ("a.spz", ("--spz-version", "3"))])
def test_every_format_comes_back_up_to_its_rounding(tmp_path: Path, name: str, options: tuple[str, ...]):
    if name.endswith(".spz") and not options:
        pytest.importorskip("zstandard")
    known = some_splat()
    save_ply(tmp_path / "ours.ply", known)
    splat_transform(*options, tmp_path / "ours.ply", tmp_path / name)
    splat = load_splat(tmp_path / name)
    assert splat.format == FORMATS[name]
    if splat.format == "glTF":
        known = move_gaussians(HALF_TURN, known)
    order = torch.cdist(splat.gaussians.means.double(), known.means.double()).argmin(1)  # some formats sort them
    assert sorted(order.tolist()) == list(range(COUNT))
    known = known.map(lambda tensor: tensor[order])
    read, sizes = splat.gaussians.colour, covariance(known.colour.quaternions, known.colour.scales)
    assert (splat.gaussians.means - known.means).abs().max() < 0.005
    assert (splat.gaussians.opacities - known.opacities).abs().max() < 0.003
    assert (covariance(read.quaternions, read.scales) - sizes).abs().max() < 0.08 * sizes.max()
    step = {"SPZ": 0.07, "compressed PLY": 0.02}.get(splat.format, 1e-5)  # 4 and 8 bits
    assert (read.features - known.colour.features).abs().max() < step


@pytest.mark.parametrize("name", FORMATS)
def test_images_of_a_reconstruction_are_equal_to_35_db_after_every_format(tmp_path: Path, name: str):
    """The included room, from the camera of a photo that the reconstruction does not have."""
    if name.endswith(".spz"):
        pytest.importorskip("zstandard")
    scene = semgs.open_scene(demo_scene())
    known = semgs.load("small")(scene.read([5, 7])).gaussians
    camera = scene.read([6]).cameras
    save_ply(tmp_path / "ours.ply", known)
    splat_transform(tmp_path / "ours.ply", tmp_path / name)
    read = load_splat(tmp_path / name)
    gaussians = move_gaussians(HALF_TURN, read.gaussians) if read.format == "glTF" else read.gaussians
    assert len(gaussians) == len(known)
    ours, theirs = (semgs.render(splat, camera).images for splat in (replace(known, semantic=None), gaussians))
    assert psnr(theirs, ours).item() > 35


def test_gaussians_of_one_label_can_be_filtered(tmp_path: Path):
    labels = (np.arange(COUNT) % 7).astype(np.uint8)
    known = some_splat()
    save_ply(tmp_path / "ours.ply", known, {"label": labels, "confidence": np.linspace(0, 1, COUNT)}, ["label 4 chair"])
    splat_transform(tmp_path / "ours.ply", "-V", "label,eq,4", tmp_path / "chairs.ply")
    chairs = load_splat(tmp_path / "chairs.ply")
    assert len(chairs) == 100
    assert chairs.extra["label"].tolist() == [4] * 100
    torch.testing.assert_close(chairs.gaussians.means, known.means[4::7], rtol=1e-6, atol=1e-6)
