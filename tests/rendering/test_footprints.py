"""Footprints: the blur of a pixel belongs to the Gaussians, so that images of any size and files show the same surfaces."""

from __future__ import annotations

from dataclasses import replace
from inspect import unwrap

import pytest
import torch
from golden import fill_golden
from networks import preset
from ply import read_ply
from posed import posed_views
from saved_scenes import wall

from semgs import load, open_scene
from semgs.data.demo_scene import demo_scene
from semgs.export.gltf import save_gltf
from semgs.export.ply import save_ply, save_semantic_ply
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians, move_gaussians
from semgs.mapping.voxels import join_in_voxels
from semgs.rendering.render import render
from semgs.scene.scene_file import load_scene, save_scene
from semgs.splats.load import load_splat

DEPTH, FOCAL = 2.0, 100.0

FOOTPRINT = 1.2e-4
"""0.3 px^2 (2 m / 100 px)^2 [m^2]."""


def one_gaussian() -> Gaussians:
    """One Gaussian 2 m in front of the origin, with another shape for its class."""

    def shape(scales: list[float], features: torch.Tensor) -> Appearance:
        turned = torch.nn.functional.normalize(torch.tensor([[1.0, 0.2, -0.3, 0.4]]), dim=-1)
        return Appearance(turned, torch.tensor([scales]), features)

    return Gaussians(
        means=torch.tensor([[0.1, -0.05, DEPTH]]),
        opacities=torch.tensor([0.9]),
        colour=shape([0.004, 0.02, 0.001], torch.full((1, 1, 3), 0.7)),
        semantic=shape([0.03, 0.01, 0.002], torch.tensor([[0.8, 0.2]])),
        footprints=torch.tensor([FOOTPRINT]),
    )


def camera(times: int = 1, nearer: float = 0.0) -> Cameras:
    """The own camera of that Gaussian, with so many times its pixels, and so much nearer [m]."""
    pose = torch.eye(4, dtype=torch.float64)
    pose[2, 3] = nearer
    focal, middle = FOCAL * times, (20.0 * times, 15.0 * times)
    intrinsics = torch.tensor([[focal, 0, middle[0]], [0, focal, middle[1]], [0, 0, 1]], dtype=torch.float64)
    return Cameras(pose[None], intrinsics[None], (30 * times, 40 * times))


@pytest.mark.parametrize(
    ("times", "nearer", "added"),
    [
        (3, 0.0, 1.2e-4 - 0.3 * (2 / 300) ** 2),
        (1, 1.0, 0.3 * (4 - 1) / 1e4),
        (2, -2.0, 0.0),  # twice as far with twice the pixels: a pixel is as large there as in the own view
        (1, -1.0, 0.0),  # farther: its pixels blur more than enough
        (1, 0.0, 0.0),
    ],
)
def test_a_camera_adds_what_its_own_pixels_lack(times: int, nearer: float, added: float):
    gaussians, seen = one_gaussian(), camera(times, nearer)
    expected = render(gaussians.blurred(torch.tensor([added])), seen, near=0.1)
    found = render(gaussians, seen, near=0.1, footprint=True)
    for name in ("images", "semantics", "alphas"):
        torch.testing.assert_close(getattr(found, name), getattr(expected, name), rtol=1e-4, atol=2e-6)
    paper = render(gaussians, seen, near=0.1)
    assert torch.equal(paper.images, render(replace(gaussians, footprints=None), seen, near=0.1).images)
    assert (added == 0) == bool((found.images - paper.images).abs().max() < 2e-6)


def test_shapes_widen_evenly_in_both_branches():
    widened = one_gaussian().blurred(torch.tensor([9e-6]))
    assert widened.footprints is None
    assert widened.colour.scales[0].tolist() == pytest.approx([0.005, 0.02022375, 0.00316228], rel=1e-5)  # 3, 4, 5
    assert widened.semantic is not None
    assert widened.semantic.scales[0].tolist() == pytest.approx([0.03014963, 0.01044031, 0.00360555], rel=1e-5)


def test_splats_of_other_programs_have_none():
    gaussians = replace(one_gaussian(), footprints=None)
    big = camera(3)
    assert torch.equal(render(gaussians, big, footprint=True).images, render(gaussians, big).images)
    assert gaussians.with_footprints() is gaussians


@pytest.mark.parametrize("name", ["small", "base"])
def test_the_network_gives_the_blur_of_each_gaussians_own_view(name: str):
    views = posed_views(2, (32, 48))
    model = fill_golden(preset(name)).eval()
    with torch.no_grad():
        encoding = model(views)
    poses, focal = views.cameras.world_from_camera, views.cameras.intrinsics.diagonal(dim1=-2, dim2=-1)[:, :2]
    own = encoding.own_views
    away = encoding.gaussians.means.double() - poses[own, :3, 3]
    depths = (away * poses[own, :3, 2]).sum(-1)
    expected = 0.3 * depths.square() / focal.prod(-1)[own]
    assert encoding.gaussians.footprints is not None
    torch.testing.assert_close(encoding.gaussians.footprints.double(), expected, rtol=1e-4, atol=0)


def test_they_follow_changes_of_scale_and_of_depth():
    gaussians = one_gaussian()
    moved = move_gaussians(torch.eye(4, dtype=torch.float64), gaussians, scale=3.0)
    assert moved.footprints is not None
    assert moved.footprints.tolist() == pytest.approx([9 * FOOTPRINT])
    views = posed_views(2, (32, 48))
    model = fill_golden(preset("small")).eval()
    with torch.no_grad():
        encoding = model(views)
    depths = encoding.placed_depths(views.cameras)
    twice = encoding.with_depths(2 * depths, views.cameras)
    assert encoding.gaussians.footprints is not None
    torch.testing.assert_close(twice.gaussians.footprints, 4 * encoding.gaussians.footprints, rtol=1e-4, atol=0)


def test_of_a_voxel_the_smallest_stays():
    two = one_gaussian().map(lambda tensor: torch.cat((tensor, tensor)))
    assert two.footprints is not None
    two = replace(two, footprints=torch.tensor([3e-4, 2e-4]))
    joined, _ = join_in_voxels(two, torch.arange(2), 0.5)
    assert joined.footprints is not None
    assert joined.footprints.tolist() == pytest.approx([2e-4])


def test_a_scene_file_keeps_them(tmp_path):
    scene = wall()
    footprints = torch.linspace(1e-6, 1e-4, len(scene.gaussians))
    save_scene(tmp_path / "a.safetensors", replace(scene, gaussians=replace(scene.gaussians, footprints=footprints)))
    read = load_scene(tmp_path / "a.safetensors").gaussians.footprints
    assert read is not None
    assert torch.equal(read, footprints)
    save_scene(tmp_path / "b.safetensors", replace(scene, gaussians=replace(scene.gaussians, footprints=None)))
    assert load_scene(tmp_path / "b.safetensors").gaussians.footprints is None


def test_negative_ones_and_another_count_are_refused():
    gaussians = one_gaussian()
    with pytest.raises(ValueError, match="footprints contain -1"):
        replace(gaussians, footprints=torch.tensor([-1.0])).checked()
    with pytest.raises(ValueError, match=r"footprints are \(2,\); expected \(1,\), one for each Gaussian"):
        unwrap(Gaussians.__init__)(
            gaussians, gaussians.means, gaussians.opacities, gaussians.colour, None, torch.ones(2)
        )


def test_a_ply_has_them_in_its_scales_and_says_so(tmp_path):
    gaussians = one_gaussian()
    save_ply(tmp_path / "a.ply", gaussians)
    header = (tmp_path / "a.ply").read_bytes().partition(b"end_header")[0].decode()
    assert "comment SemGS: scales contain the blur of a pixel; its variance is nx\n" in header
    plain = read_ply(tmp_path / "a.ply")  # as any viewer does
    expected = [(side**2 + FOOTPRINT) ** 0.5 for side in (0.004, 0.02, 0.001)]
    assert plain.colour.scales[0].tolist() == pytest.approx(expected, rel=1e-5)
    ours = load_splat(tmp_path / "a.ply")
    assert ours.gaussians.footprints is not None
    assert ours.gaussians.footprints.tolist() == pytest.approx([FOOTPRINT])
    assert ours.gaussians.colour.scales[0].tolist() == pytest.approx([0.004, 0.02, 0.001], rel=1e-3)
    assert not ours.extra
    assert ours.comments == ()


def test_a_ply_that_lost_its_mark_or_lies_is_read_as_it_is(tmp_path):
    save_ply(tmp_path / "a.ply", one_gaussian())
    data = (tmp_path / "a.ply").read_bytes()
    wide = [(side**2 + FOOTPRINT) ** 0.5 for side in (0.004, 0.02, 0.001)]
    (tmp_path / "lost.ply").write_bytes(
        data.replace(b"comment SemGS: scales contain", b"comment somebody's scales con")
    )
    lost = load_splat(tmp_path / "lost.ply")
    assert lost.gaussians.footprints is None
    assert lost.gaussians.colour.scales[0].tolist() == pytest.approx(wide, rel=1e-5)
    save_ply(
        tmp_path / "lies.ply",
        replace(one_gaussian(), footprints=None),
        comments=["SemGS: scales contain the blur of a pixel; its variance is nx"],
    )
    lies = (tmp_path / "lies.ply").read_bytes()
    body = lies.index(b"end_header\n") + len(b"end_header\n")
    number = torch.tensor([1.0]).numpy().tobytes()  # a variance of 1 m^2, more than the scales are
    (tmp_path / "lies.ply").write_bytes(lies[: body + 12] + number + lies[body + 16 :])
    read = load_splat(tmp_path / "lies.ply").gaussians
    assert read.footprints is None
    assert read.colour.scales[0].tolist() == pytest.approx([0.004, 0.02, 0.001], rel=1e-5)


def test_class_files_have_them_in_the_shapes_of_the_classes(tmp_path):
    scene = wall()
    footprints = torch.full((len(scene.gaussians),), 1e-4)
    assert scene.gaussians.semantic is not None
    assert scene.classes is not None
    save_semantic_ply(tmp_path / "a.ply", replace(scene.gaussians, footprints=footprints), scene.classes)
    expected = (scene.gaussians.semantic.scales.square() + 1e-4).sqrt()
    torch.testing.assert_close(read_ply(tmp_path / "a.ply").colour.scales, expected)


def test_gltf_has_them_in_its_scales_and_gives_them_back(tmp_path):
    scene = wall()
    footprints = torch.linspace(1e-6, 1e-4, len(scene.gaussians))
    save_gltf(tmp_path / "a.glb", replace(scene, gaussians=replace(scene.gaussians, footprints=footprints)))
    splat = load_splat(tmp_path / "a.glb")
    assert splat.gaussians.footprints is not None
    torch.testing.assert_close(splat.gaussians.footprints, footprints)
    torch.testing.assert_close(splat.gaussians.colour.scales, scene.gaussians.colour.scales, rtol=1e-3, atol=1e-5)
    assert "_FOOTPRINT" not in splat.extra


def test_three_times_the_pixels_show_the_same_room_without_gaps():
    scene = open_scene(demo_scene())
    views, held_out = scene.read([5, 7], (120, 160)), scene.read([6], (120, 160))
    encoding = load("small")(views)
    cameras = Cameras(
        torch.cat((views.cameras.world_from_camera, held_out.cameras.world_from_camera)),
        torch.cat((views.cameras.intrinsics, held_out.cameras.intrinsics)),
        views.cameras.size,
    )
    larger = Cameras(
        cameras.world_from_camera, torch.diag(torch.tensor([3.0, 3, 1])).double() @ cameras.intrinsics, (360, 480)
    )
    once = encoding.render(cameras)
    for footprint, least, most in ((True, 47.0, 99.0), (False, 20.0, 40.0)):
        thrice = encoding.render(larger, footprint=footprint)
        error = (torch.nn.functional.avg_pool2d(thrice.images, 3) - once.images).square().mean((1, 2, 3))
        decibels = -10 * error.log10()
        assert decibels.min() >= least, decibels
        assert decibels.max() <= most, decibels
        gaps = float((thrice.alphas < 0.9).double().mean() - (once.alphas < 0.9).double().mean())
        assert (gaps <= 0.01) == footprint, gaps
