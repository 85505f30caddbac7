"""A splat in other coordinates than the photos: the similarity is found by features."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from math import acos, degrees
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter

from semgs.data.scenes import open_scene
from semgs.files.images.pictures import write_png
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.rendering.render import render
from semgs.splats.fit_by_features import SharedFeatures, _fit, move_by, scale_of
from semgs.splats.scene_opening import _Likeness, fit_to_scene

SIZE = (120, 160)


def corner(seed: int, side: int = 90) -> Gaussians:
    """A floor and two walls of 3 x 3 units with a texture of blobs that differs by seed."""
    draw = np.random.default_rng(seed)
    u, v = (axis.ravel() for axis in np.meshgrid(*[np.linspace(0, 3, side)] * 2, indexing="ij"))
    zero = np.zeros_like(u)
    means = np.concatenate([np.stack(plane, -1) for plane in ((u, v, zero), (u, zero, v), (zero, u, v))])
    blobs = np.stack([gaussian_filter(draw.normal(size=(3, side, side)), (0, 1.5, 1.5)) for _ in range(3)], -1)
    features = torch.from_numpy(blobs.reshape(-1, 1, 3) / blobs.std()).float()
    shape = Appearance(torch.eye(4)[:1].repeat(len(means), 1), torch.full((len(means), 3), 0.02), features)
    return Gaussians(torch.from_numpy(means).float(), torch.full((len(means),), 0.95), shape)


def photograph(folder: Path, gaussians: Gaussians, gain: float = 1.0) -> Path:
    """A scene of five photos that look into the corner."""
    (folder / "images").mkdir(parents=True)
    listed = []
    for index in range(5):
        eye = np.array([3.0 - 0.3 * index, 1.6 + 0.35 * index, 1.5 + 0.1 * (index % 2)])
        forward = np.array([0.4, 0.5, 0.6]) - eye
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.stack((right, np.cross(forward, right), forward), 1), eye
        k = torch.tensor([[130.0, 0, 77], [0, 131, 63], [0, 0, 1]], dtype=torch.float64)
        image = gain * render(gaussians, Cameras(torch.from_numpy(pose)[None], k[None], SIZE)).images[0].clamp(0, 1)
        write_png(folder / f"images/{index}.png", (255 * image.movedim(0, -1).numpy()).round().astype(np.uint8))
        listed.append(
            {"file_path": f"images/{index}.png", "transform_matrix": (pose @ np.diag([1, -1, -1, 1])).tolist()}
        )
    lens = {"w": SIZE[1], "h": SIZE[0], "fl_x": 130.0, "fl_y": 131.0, "cx": 77.0, "cy": 63.0}
    (folder / "transforms.json").write_text(json.dumps({"camera_model": "PINHOLE", **lens, "frames": listed}))
    return folder


def motion(quaternion: list[float], scale: float, shift: list[float]) -> torch.Tensor:
    """[s R | t]."""
    matrix = torch.eye(4, dtype=torch.float64)
    unit = torch.nn.functional.normalize(torch.tensor(quaternion, dtype=torch.float64), dim=0)
    matrix[:3, :3], matrix[:3, 3] = scale * matrix_from_quaternion(unit), torch.tensor(shift)
    return matrix


NEAR = motion([1.0, 0.03, -0.04, 0.09], 0.9, [0.2, -0.1, 0.15])
"""12 degrees about an oblique axis: the given cameras still see what the photos show."""
FAR = motion([0.5, -0.4, 0.6, 0.2], 0.5, [40.0, -7.0, 12.0])
"""Far away: the given cameras see nothing of the splat."""


@pytest.mark.parametrize(("moved", "gain"), [(NEAR, 1.0), (NEAR, 0.4), (FAR, 1.0)], ids=["near", "near, dark", "far"])
def test_a_splat_in_other_coordinates_is_moved_to_the_photos(tmp_path: Path, moved: torch.Tensor, gain: float):
    true = corner(1)
    scene = open_scene(photograph(tmp_path / "scene", true, gain), needs_labels=False)
    found = fit_to_scene(tmp_path / "a.ply", move_by(moved, true), scene)
    assert "The photos fit the splat turned by" in found.note
    # The best similarity between the positions and the true ones says by what the found one is wrong.
    a, b = (one.means.double() - one.means.double().mean(0) for one in (found.gaussians, true))
    scale = float(b.norm() / a.norm())
    assert scale == pytest.approx(1, abs=0.01)
    u, _, v = torch.linalg.svd(b.T @ a)
    assert degrees(acos(min(1.0, (float((u @ v).trace()) - 1) / 2))) < 1
    assert float((found.gaussians.means - true.means).norm(dim=-1).max()) < 0.05
    said = re.search(r"scaled by (\S+) and", found.note)
    assert said is not None
    assert float(said[1]) == pytest.approx(1 / scale_of(moved), rel=0.01)


@pytest.mark.parametrize("gain", [1.0, 0.2])
def test_right_cameras_leave_the_splat_where_it_is(tmp_path: Path, gain: float):
    true = corner(1)
    scene = open_scene(photograph(tmp_path / "scene", true, gain), needs_labels=False)
    found = fit_to_scene(tmp_path / "a.ply", true, scene)
    assert found.note == ""
    assert torch.equal(found.gaussians.means, true.means)


def test_nothing_is_invented_for_a_splat_of_another_place(tmp_path: Path):
    scene = open_scene(photograph(tmp_path / "scene", corner(1)), needs_labels=False)
    other = corner(2)
    found = fit_to_scene(tmp_path / "a.ply", other, scene)
    assert found.note == ""
    assert torch.equal(found.gaussians.means, other.means)


def test_a_motion_that_does_not_look_clearly_better_is_not_applied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    true = corner(1, 30)
    scene = open_scene(photograph(tmp_path / "scene", true), needs_labels=False)
    monkeypatch.setattr("semgs.splats.scene_opening.find_similarity", lambda *_: NEAR)
    found = fit_to_scene(tmp_path / "a.ply", true, scene)
    assert found.note == ""
    assert torch.equal(found.gaussians.means, true.means)


def test_one_that_leaves_half_of_the_variance_clearly_beats_another():
    """0.8 leaves 1 - 0.64 = 0.36, which is half of what sqrt(0.28) = 0.5292 leaves."""
    found = _Likeness(20.0, 0.75, 0.8)
    assert found.clearly_beats(_Likeness(25.0, 0.5, 0.529))
    assert not found.clearly_beats(_Likeness(10.0, 0.5, 0.53))
    assert not replace(found, own=0.5).clearly_beats(_Likeness(10.0, 0.0, 0.0))
    assert not replace(found, own=None).clearly_beats(_Likeness(10.0, 0.0, 0.0))


def known_features(similarity: torch.Tensor) -> tuple[list[SharedFeatures], np.ndarray, np.ndarray]:
    """Sixty points of a splat that three cameras see, where the similarity leads it; a third of the pixels are wrong."""
    draw = np.random.default_rng(4)
    k = np.array([[130.0, 0, 77], [0, 131, 63], [0, 0, 1]])
    poses = np.stack([np.eye(4)] * 3)
    poses[:, :3, 3] = [[0.0, 0, 0], [0.5, 0.1, 0], [-0.2, 0.4, 0.1]]
    world = draw.uniform((-1, -1, 3), (1, 1, 5), (60, 3))
    inverse = torch.linalg.inv(similarity).numpy()
    shared = []
    for pose in poses:
        seen = (world - pose[:3, 3]) @ k.T
        pixels = seen[:, :2] / seen[:, 2:]
        pixels[::3] = draw.uniform(0, 120, (20, 2))
        shared.append(SharedFeatures(pixels, world @ inverse[:3, :3].T + inverse[:3, 3]))
    return shared, poses, np.stack([k] * 3)


@pytest.mark.parametrize("similarity", [NEAR, FAR])
def test_exact_features_give_the_exact_similarity_though_a_third_is_wrong(similarity: torch.Tensor):
    found = _fit(*known_features(similarity), 3.2)
    assert found is not None
    torch.testing.assert_close(found, similarity, rtol=1e-3, atol=1e-3)


def test_features_that_stay_within_two_per_cent_say_that_the_cameras_fit():
    """0.02 units sideways, 4 units away, are 0.65 px."""
    found = _fit(*known_features(motion([1.0, 0, 0, 0], 1.0, [0.02, 0, 0])), 3.2)
    assert found is not None
    assert torch.equal(found, torch.eye(4, dtype=torch.float64))


def test_cameras_in_one_place_say_no_scale():
    shared, poses, k = known_features(NEAR)
    poses[:] = poses[0]
    assert _fit([shared[0]] * 3, poses, k, 3.2) is None
    assert _fit(shared[:1], poses[:1], k[:1], 3.2) is None
