"""Depth maps from elsewhere in `reconstruct`: a wall whose distance is known, and a network that knows it, or is 10 % off."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from run.conftest import SIZE, WALL, Oracle, look

from semgs.data.choosing.choice import choose_named
from semgs.data.choosing.coverage import choose_covering
from semgs.data.maps import InMemory
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.depth_maps.depth_source import FrameMaps
from semgs.depth_maps.map_depth import find_reference
from semgs.depth_maps.opening import open_depth_maps
from semgs.files.errors import InputError
from semgs.run.output.report import Provenance, report_numbers
from semgs.run.output.report_page import report_page
from semgs.run.steps.pipeline import reconstruct
from semgs.run.steps.result import Reconstruction
from semgs.run.steps.view_encoder import ViewEncoder, why_not
from semgs.runtime.stopwatch import Stages
from semgs.scene.encoding import Encoding

SHIFTS = (0.0, 0.08, 0.16, 0.24)
ORIGIN = Provenance("semgs 9.9", "", 0, "cpu")


class Bent(Oracle):
    """The same network, whose depth is 10 % too far on the right and too near on the left, and says so."""

    def forward(self, views: Views) -> Encoding:
        encoding = super().forward(views)
        bend = (0.1 * torch.linspace(-1, 1, SIZE[1])).exp()
        return encoding.with_depths(encoding.depths * bend, views.cameras)


def write_maps(folder: Path, maps: Sequence[np.ndarray], meaning: str, **more: object) -> Path:
    """A folder with a map of each frame of the wall."""
    folder.mkdir()
    (folder / "depth.json").write_text(json.dumps({"meaning": meaning} | more))
    for index, values in enumerate(maps):
        np.save(folder / f"{index:02d}.npy", values.astype(np.float32))
    return folder


def walls() -> list[np.ndarray]:
    """The true depth of each frame."""
    return [look(shift)[1] for shift in SHIFTS]


def run(scene: Scene, folder: Path, network: torch.nn.Module | None = None) -> Reconstruction:
    source = open_depth_maps(str(folder))(scene)
    return reconstruct(scene, replace(choose_named(scene, [0, 3]), size=SIZE), network or Oracle(), depth=source)  # type: ignore[arg-type]


@pytest.mark.parametrize("meaning", ["scaled", "inverse"])
def test_exact_maps_of_unknown_scale_straighten_a_bent_network(
    wall_scene: Callable[..., Scene], tmp_path: Path, meaning: str
):
    scene = wall_scene(metric=False)
    maps = [3 * depth if meaning == "scaled" else 2 / depth + 0.3 for depth in walls()]
    bent = reconstruct(scene, replace(choose_named(scene, [0, 3]), size=SIZE), Bent())
    straight = run(scene, write_maps(tmp_path / "maps", maps, meaning), Bent())
    truth = torch.tensor(np.stack([walls()[0], walls()[3]]))
    errors = [float((result.encoding.depths / truth).log().abs().mean()) for result in (bent, straight)]
    assert errors[0] == pytest.approx(0.05, rel=0.02)  # the mean of a line from 0 to 0.1
    assert errors[1] < 0.4 * errors[0]
    assert straight.placement is not None
    assert straight.depth_source == "maps"
    numbers = report_numbers(straight, ORIGIN, {})["depth"]
    assert numbers["from"] == f"the model and the maps of {tmp_path / 'maps'}, aligned to the model's depth"
    assert [fit["known"] for fit in numbers["fits"]] == [1, 1]
    page = report_page(straight, ORIGIN, {"read": 1.0})
    assert "Fit of the maps" in page
    assert "aligned to the model" in page
    fit = straight.placement.fits[0]
    formula = (
        f"depth = {1 / fit.scale:.4g} map"
        if meaning == "scaled"
        else f"1 / depth = {fit.scale:.4g} map {fit.shift:+.3g}"
    )
    assert f"images/00.png: 100 % known; {formula}, typical difference " in straight.depth_fits[0]


def test_a_sensor_is_the_reference_and_counts_too(wall_scene: Callable[..., Scene], tmp_path: Path):
    """The sensor measures the wall; maps of a third of the scale get the factor 1/3, although the network is bent."""
    scene = wall_scene()
    result = run(scene, write_maps(tmp_path / "maps", [depth / 3 for depth in walls()], "scaled"), Bent())
    assert result.placement is not None
    assert [fit.scale for fit in result.placement.fits] == pytest.approx([1 / 3, 1 / 3], rel=1e-3)
    assert "aligned to the sensor's depth" in result.placement.description
    torch.testing.assert_close(result.encoding.depths[0], torch.full(SIZE, WALL), rtol=0.005, atol=0)


def test_sparse_points_are_the_reference_without_a_sensor(wall_scene: Callable[..., Scene], tmp_path: Path):
    scene = wall_scene(metric=False)
    views = scene.read([0, 3], SIZE)
    encoding = Oracle()(views)
    points = encoding.gaussians.means[::7].double().numpy()
    seen = np.arange(len(points))
    frames = tuple(replace(frame, points=seen) for frame in scene.frames)
    with_points = replace(scene, frames=frames, points=points)
    reference = find_reference(encoding, with_points, [0, 3], views)
    assert reference.title == "the scene's sparse points"
    assert 100 < int((reference.depths[0] > 0).sum()) <= len(points)
    known = reference.depths[0] > 0
    torch.testing.assert_close(reference.depths[0][known], torch.full((int(known.sum()),), WALL), rtol=1e-4, atol=0)
    few = replace(scene, frames=frames, points=points[:50])
    few = replace(few, frames=tuple(replace(frame, points=np.arange(50)) for frame in scene.frames))
    assert find_reference(encoding, few, [0, 3], views).title == "the model's depth"


def test_of_sparse_points_behind_one_another_the_nearest_is_seen(wall_scene: Callable[..., Scene]):
    """Each point of the wall has one behind it and one before it on the ray of the first camera, at 1.5 and 0.5 times its depth."""
    scene = wall_scene(metric=False)
    views = scene.read([0, 3], SIZE)
    encoding = Oracle()(views)
    wall, centre = encoding.gaussians.means[::7].double().numpy(), scene.frames[0].world_from_camera[:3, 3]
    points = np.concatenate([centre + share * (wall - centre) for share in (0.5, 1.0, 1.5)])
    frames = tuple(replace(frame, points=np.arange(len(points))) for frame in scene.frames)
    reference = find_reference(encoding, replace(scene, frames=frames, points=points), [0, 3], views)
    found = reference.depths[0][reference.depths[0] > 0]
    assert len(found) > 100
    assert float((found < 0.51 * WALL).double().mean()) > 0.95


def test_the_scenes_own_maps_are_no_reference_for_themselves(wall_scene: Callable[..., Scene]):
    scene = wall_scene()
    result = reconstruct(scene, replace(choose_named(scene, [0, 3]), size=SIZE), Oracle(), depth=FrameMaps())  # type: ignore[arg-type]
    assert result.placement is not None
    assert "the scene's own depth maps, aligned to the model's depth" in result.placement.description
    assert [fit.scale for fit in result.placement.fits] == pytest.approx([1, 1], rel=2e-3)
    with pytest.raises(InputError, match="a depth map of this frame"):
        FrameMaps().of(wall_scene(metric=False, moved=(1, 0, 0)).frames[0], SIZE)


def test_a_view_whose_map_does_not_fit_keeps_the_models_depth_and_a_note_names_it(
    wall_scene: Callable[..., Scene], tmp_path: Path
):
    noise = 1 + 4 * np.random.default_rng(0).random(SIZE)
    maps = [depth if index < 3 else noise for index, depth in enumerate(walls())]
    result = run(wall_scene(metric=False), write_maps(tmp_path / "maps", maps, "scaled"))
    assert any("images/03.png" in note and "their depth is the model's alone" in note for note in result.notes)
    truth = torch.full(SIZE, WALL - 0.1 * SHIFTS[3])
    torch.testing.assert_close(result.encoding.depths[1], truth, rtol=1e-4, atol=0)


@pytest.mark.parametrize("gap", ["no map", "an empty map"])
def test_frames_without_a_depth_map_of_their_own_are_left_out(wall_scene: Callable[..., Scene], gap: str):
    """The second of four frames has no depth, and the third is held out. Without depth, it counts as the typical depth, 2.24 m; the others see a wall at 2 m."""
    scene = wall_scene(shifts=(0.0, 0.2, 0.4, 0.6))
    empty = None if gap == "no map" else InMemory(np.zeros(SIZE, np.float32))
    frames = tuple(replace(frame, depth=empty) if index == 1 else frame for index, frame in enumerate(scene.frames))
    scene = replace(scene, frames=frames)
    choice = choose_covering(scene, None, lambda position, bounds: why_not(scene, position, SIZE, FrameMaps(), bounds))
    assert choice.context == (0, 3)
    assert choice.targets == (2,)
    assert choice.notes[0] == "Left out: images/01.png. No input view shares 30% of what they see."
    assert "images/01.png" in (why_not(scene, 1, SIZE, FrameMaps(), scene.depth_range()) or "")


@pytest.mark.parametrize("meaning", ["scaled", "metric"])
def test_a_window_whose_maps_do_not_fit_ends_a_walk_only_if_none_before_it_fitted(
    wall_scene: Callable[..., Scene], tmp_path: Path, meaning: str
):
    """The maps of the first two frames are right, those of the other two noise. After the noise alone, the depth is the network's: the wall's."""
    noise = 1 + 4 * np.random.default_rng(0).random(SIZE)
    maps = [depth if index < 2 else noise for index, depth in enumerate(walls())]
    scene = wall_scene(metric=False)
    source = open_depth_maps(str(write_maps(tmp_path / "maps", maps, meaning)))(scene)
    windows = [([position, position + 1], scene.read([position, position + 1], SIZE)) for position in (0, 2)]
    encoder = ViewEncoder(scene, Oracle(), SIZE, source, None, Stages())  # type: ignore[arg-type]
    with pytest.raises(InputError, match="they may be of other photos"):
        encoder.encode(*windows[1])
    encoder.encode(*windows[0])
    placed = encoder.encode(*windows[1])
    truth = torch.tensor(np.stack(walls()[2:])).float()
    torch.testing.assert_close(placed.depths, truth, rtol=1e-4, atol=0)


@pytest.mark.parametrize(
    ("change", "meaning", "message"),
    [
        (lambda depth: 1000 * depth, "metric", r"depth in metres, found 1e\+03 times the depth of the model's depth"),
        (lambda depth: 1 / (depth + np.linspace(0, 1, SIZE[1])), "scaled", "they fit as inverse: --depth-meaning inverse"),
        (lambda depth: 1 + 4 * np.random.default_rng(0).random(SIZE), "scaled", "they may be of other photos"),
        (lambda depth: np.full(SIZE, np.nan), "scaled", "a depth somewhere in the map of images/00.png, found none"),
    ],
)  # fmt: skip
def test_maps_in_another_unit_or_convention_or_of_other_photos_are_refused(
    wall_scene: Callable[..., Scene],
    tmp_path: Path,
    change: Callable[[np.ndarray], np.ndarray],
    meaning: str,
    message: str,
):
    maps = write_maps(tmp_path / "maps", [change(depth) for depth in walls()], meaning)
    network = Sloping() if "inverse" in message else Oracle()
    with pytest.raises(InputError, match=message):
        run(wall_scene(metric=False), maps, network)


class Sloping(Oracle):
    """The network for a wall that falls back by 1 m from left to right."""

    def forward(self, views: Views) -> Encoding:
        encoding = super().forward(views)
        return encoding.with_depths(encoding.depths + torch.linspace(0, 1, SIZE[1]), views.cameras)
