"""Gaussians at the depth of a sensor: where they go, what they become, and what is said about it."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from run.conftest import SIZE, Oracle

from semgs.data.choosing.choice import choose_named
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.depth_maps.sensor_depth import OPACITY, Registration, place_gaussians, sensor_spread
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_uint16, write_png
from semgs.geometry.cameras import Cameras
from semgs.run.output.files import summary
from semgs.run.output.report import Provenance, report_numbers
from semgs.run.output.report_page import report_page
from semgs.run.steps.pipeline import reconstruct
from semgs.scene.encoding import Encoding
from semgs.scene.scene_file import load_scene, save_scene

ORIGIN = Provenance("semgs 9.9", "drawn from a hat", 1234567, "cpu")


class Mistaken(Oracle):
    """A network that sees everything at 1.25 times its depth."""

    def forward(self, views: Views) -> Encoding:
        encoding = super().forward(views)
        return encoding.with_depths(1.25 * encoding.depths, views.cameras)


@pytest.fixture
def views(wall_scene: Callable[..., Scene]) -> Views:
    """Two views of the wall: 2 m and 1.976 m of exact depth, in whole millimetres."""
    return wall_scene().read([0, 3], SIZE)


def test_a_sensor_puts_the_wall_where_it_is(wall_scene: Callable[..., Scene]):
    scene = wall_scene()
    by_source = {
        source: reconstruct(scene, choose_named(scene, [0, 3]), Mistaken(), depth=source)  # type: ignore[arg-type]
        for source in ("network", "sensor", "both")
    }
    errors = {source: result.target.scores[0].depth.abs_rel for source, result in by_source.items() if result.target}
    assert errors["network"] > 0.2
    assert errors["sensor"] < 0.002
    assert errors["both"] < 0.002
    assert by_source["sensor"].target.scores[0].psnr > by_source["network"].target.scores[0].psnr + 3


def test_measured_pixels_have_the_measured_depth_and_holes_the_networks_as_the_sensor_would_see_it(views: Views):
    """The network's 2.5 m are 2 m for the sensor: in the hole too, with the network's opacity and its own doubt."""
    depths = views.depths.clone()
    depths[:, 10:20, 5:30] = 0
    views = replace(views, depths=depths)
    before = Mistaken()(views)
    after = place_gaussians(before, views, "sensor")[0]
    hole = depths == 0
    torch.testing.assert_close(after.depths[~hole], depths[~hole])
    torch.testing.assert_close(after.depths[0, 10:20, 5:30], torch.full((10, 25), 2.0), atol=2e-3, rtol=0)
    torch.testing.assert_close(after.opacity_maps()[~hole], torch.full_like(depths[~hole], OPACITY))
    assert (after.opacity_maps()[hole] == 0.9).all()
    assert (after.confidences[~hole] == 1).all()
    assert (after.confidences[hole] == 0.5).all()
    torch.testing.assert_close(after.depth_spread[~hole], sensor_spread(depths[~hole]))
    torch.testing.assert_close(after.depth_spread[hole], torch.full_like(depths[hole], 0.1), atol=1e-3, rtol=0)
    torch.testing.assert_close(after.placed_depths(views.cameras), after.depths)


def test_the_noise_of_a_depth_camera_grows_with_depth_squared():
    """At 2.4 m: 1.2 mm + 1.9 mm * 2^2 = 8.8 mm; at 0.4 m 1.2 mm."""
    found = sensor_spread(torch.tensor([2.4, 0.4]))
    assert found.tolist() == pytest.approx([0.0088 / 2.4, 0.0012 / 0.4])


def test_both_weighs_log_depths_by_their_inverse_variances(views: Views):
    """The network, fitted, says 2 m with 10 %; one pixel of the sensor 2.4 m with 8.8 mm: 0.9987 of its logarithm; as sure as both together."""
    depths = views.depths.clone()
    depths[0, 7, 9] = 2.4
    views = replace(views, depths=depths)
    before = Mistaken()(views)
    after = place_gaussians(before, views, "both")[0]
    noise, variance = (0.0088 / 2.4) ** 2, 0.1**2
    weight = variance / (variance + noise)
    assert weight == pytest.approx(0.99866, abs=1e-5)
    expected = 2.4**weight * 2.0 ** (1 - weight)
    assert after.depths[0, 7, 9].item() == pytest.approx(expected, rel=1e-4)
    assert after.depth_spread[0, 7, 9].item() == pytest.approx((noise * variance / (noise + variance)) ** 0.5, rel=1e-3)
    assert after.opacity_maps()[0, 7, 9].item() == pytest.approx(weight * OPACITY + (1 - weight) * 0.9, rel=1e-4)
    assert after.confidences[0, 7, 9].item() == pytest.approx(weight + (1 - weight) * 0.5, rel=1e-4)


@pytest.mark.parametrize("unit", [1000.0, 1e-4])
def test_a_sensor_counts_as_much_in_a_unit_that_nobody_knows(views: Views, unit: float):
    """The same scene with 1,000 or 0.0001 units a metre, near and far of rooms: noise that grows with the square of 2,000 would be 3.8 instead of
    0.0037 at 2.4 m, and the sensor would not count."""
    depths = views.depths.clone()
    depths[0, 7, 9] = 2.4
    views = replace(views, depths=depths)
    expected = place_gaussians(Mistaken()(views), views, "both")[0]
    poses = views.cameras.world_from_camera.clone()
    poses[:, :3, 3] *= unit
    scaled = replace(
        views,
        cameras=Cameras(poses, views.cameras.intrinsics, views.size),
        depth_range=unit * views.depth_range,
        depths=unit * depths,
    )
    before = Mistaken()(views)
    shapes = {
        name: replace(shape, scales=unit * shape.scales)
        for name, shape in (("colour", before.gaussians.colour), ("semantic", before.gaussians.semantic))
        if shape is not None
    }
    gaussians = replace(before.gaussians, means=unit * before.gaussians.means, **shapes)
    given = replace(before, gaussians=gaussians, depths=unit * before.depths, depth_range=scaled.depth_range)
    found = place_gaussians(given, scaled, "both", metric=False)[0]
    torch.testing.assert_close(found.depths / unit, expected.depths, rtol=1e-4, atol=0)
    torch.testing.assert_close(found.depth_spread, expected.depth_spread, rtol=1e-3, atol=1e-6)
    assert found.depths[0, 7, 9].item() / unit == pytest.approx(2.4, rel=1e-3)


def test_the_summary_the_report_and_the_scene_file_tell_of_it(wall_scene: Callable[..., Scene], tmp_path: Path):
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), Mistaken(), depth="sensor")
    told = summary(result, {"read": 1.0}, tmp_path)
    assert "images/00.png: 100 % measured; 1 / sensor = 1.250 / network +0.000, typical difference 0 %" in told
    numbers = json.loads(json.dumps(report_numbers(result, ORIGIN, {}), allow_nan=False))["depth"]
    assert numbers["source"] == "sensor"
    assert [fit["name"] for fit in numbers["fits"]] == ["images/00.png", "images/03.png"]
    assert numbers["fits"][0] | {"shift": 0, "residual": 0} == {
        "name": "images/00.png", "measured": 1.0, "ratio": 0.8, "scale": 1.25, "shift": 0, "residual": 0,
    }  # fmt: skip
    assert "the sensor" in report_page(result, ORIGIN, {"read": 1.0})
    assert not [note for note in result.notes if "does not fit" in note]
    save_scene(tmp_path / "scene.safetensors", result.saved)
    again = load_scene(tmp_path / "scene.safetensors")
    assert torch.equal(again.depths, result.encoding.depths)
    assert again.depths.mean().item() == pytest.approx(1.988, abs=2e-3)
    assert (again.confidences == 1).all()


def test_without_a_sensor_the_report_says_that_depth_is_the_networks(wall_scene: Callable[..., Scene]):
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), Oracle())
    assert report_numbers(result, ORIGIN, {})["depth"] == {
        "source": "network", "fits": [], "from": "the model", "shift_px": None,
    }  # fmt: skip


@pytest.mark.parametrize("factor", [10.0, 1000.0, 0.001])
def test_depth_in_another_unit_is_noted(views: Views, factor: float):
    """x10 and x1000, as for centimetres or metres that are millimetres: the residual is zero, the ratio is not 1."""
    wrong = replace(views, depths=views.depths * factor)
    (note,) = place_gaussians(Oracle()(views), wrong, "sensor")[1].notes(["a.png", "b.png"])
    assert f"a.png (sensor / model {factor:g}, typical difference" in note
    assert "b.png" in note
    assert "--depth-unit" in note


def test_depth_that_lies_beside_the_image_is_noted(wall_scene: Callable[..., Scene]):
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), Oracle(), depth="both")
    assert result.placement is not None
    assert result.placement.notes(["a.png", "b.png"]) == ()
    beside = replace(result.placement, registration=Registration(right=10, down=-4, gain=2.0, pixels=5000))
    (note,) = beside.notes(["a.png", "b.png"])
    assert "not registered" in note
    assert "moves by about -10 px to the right and 4 px down" in note
    assert report_numbers(replace(result, placement=beside), ORIGIN, {})["depth"]["shift_px"] == [10, -4]


def test_depth_for_too_few_pixels_is_refused_by_the_name_of_its_frame(wall_scene: Callable[..., Scene]):
    """A mask hides all but the first 15 of 40 rows of one frame: 38 %; at half of the rows all is well."""
    scene = wall_scene()
    depth_file = scene.path.parent / "depth/03.png"
    counts = read_uint16(depth_file)
    counts[15:] = 0
    write_png(depth_file, counts)
    with pytest.raises(
        InputError, match=r"transforms.json: images/03.png: expected a measured depth at 50 % .*, found 38 %"
    ):
        reconstruct(scene, replace(choose_named(scene, [0, 3]), size=SIZE), Oracle(), depth="both")
    counts[15:20] = 1976
    write_png(depth_file, counts)
    assert (
        reconstruct(scene, replace(choose_named(scene, [0, 3]), size=SIZE), Oracle(), depth="both").placement
        is not None
    )


def test_views_without_depth_are_refused(views: Views):
    with pytest.raises(ValueError, match="have no depths"):
        place_gaussians(Oracle()(views), replace(views, depths=None), "sensor")
