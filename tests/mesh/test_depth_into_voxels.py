"""Depth fused into a signed distance field: the kernel against its specification in NumPy, and surfaces that are known."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from posed import posed_cameras
from wall_and_chair import pose

from semgs.geometry.cameras import Cameras, back_project
from semgs.mesh import fusion
from semgs.mesh.fusion import SIDE, DepthMap, fuse, planes_of
from semgs.mesh.fusion_kernels import integrate

K = torch.tensor([[50.0, 0, 33.0], [0, 52.0, 20.0], [0, 0, 1]], dtype=torch.float64)
SIZE = (40, 64)


def fused_slowly(
    points: np.ndarray,
    truncation: float,
    planes: np.ndarray,
    worth: np.ndarray,
    camera_from_world: np.ndarray,
    lens: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The specification of `integrate`: weighted distance and weight of each point [n] from one depth map."""
    x, y, z = (points @ camera_from_world[:3, :3].T + camera_from_world[:3, 3]).T
    sums, weights = np.zeros(len(points)), np.zeros(len(points))
    for at in range(len(points)):
        if z[at] <= 0:
            continue
        ray = np.array([x[at] / z[at], y[at] / z[at], 1.0])
        column, row = lens[0] * ray[0] + lens[2], lens[1] * ray[1] + lens[3]
        if not (0 <= column < worth.shape[1] and 0 <= row < worth.shape[0]) or worth[int(row), int(column)] <= 0:
            continue
        inverse, across, along = planes[int(row), int(column)]
        slopes = np.array([lens[0] * across, lens[1] * along])
        here = inverse + across * (column - int(column) - 0.5) + along * (row - int(row) - 0.5)
        normal = np.array([*slopes, here - slopes @ ray[:2]])  # the plane is where normal @ point = 1
        distance = (1 - normal @ (z[at] * ray)) / np.linalg.norm(normal) / truncation
        if here > 0 and distance >= -1:
            weights[at] = worth[int(row), int(column)] * normal @ ray / np.linalg.norm(normal) / np.linalg.norm(ray)
            weights[at] *= 1 + min(distance, 0.0)
            sums[at] = weights[at] * min(distance, 1.0)
    return sums, weights


def test_the_kernel_agrees_with_its_specification() -> None:
    draw = np.random.default_rng(3)
    (camera,) = (posed_cameras(1, (23, 31))[one] for one in range(1))
    depths = 2 + 0.3 * draw.random((23, 31))
    worth = draw.random((23, 31)) * (draw.random((23, 31)) > 0.2)
    near = back_project(torch.full((23, 31), 2.0, dtype=torch.float64), camera).numpy().reshape(-1, 3)
    voxel = 0.05
    blocks = np.unique(np.floor(near / (SIDE * voxel)).astype(np.int64), axis=0)
    blocks = np.concatenate((blocks, blocks - 3, blocks + 40))
    planes, _ = planes_of(depths, 1.0)
    matrix = camera.intrinsics.numpy()
    lens = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]])
    sums, weights = np.zeros((2, len(blocks), SIDE, SIDE, SIDE), np.float32)
    integrate(sums, weights, blocks, voxel, 0.2, planes, worth, camera.camera_from_world.numpy(), lens, 0, 1)
    inside = np.stack(np.meshgrid(*[np.arange(SIDE)] * 3, indexing="ij"), -1).reshape(-1, 3)
    points = (SIDE * blocks[:, None] + inside).reshape(-1, 3) * voxel
    slow = fused_slowly(points, 0.2, planes, worth, camera.camera_from_world.numpy(), lens)
    assert (slow[1] > 0).sum() > 1000
    np.testing.assert_allclose(sums.reshape(-1), slow[0], atol=1e-5)
    np.testing.assert_allclose(weights.reshape(-1), slow[1], atol=1e-5)


def test_the_distance_from_a_slanted_plane_is_that_along_its_normal() -> None:
    """The plane z = 2 + x: the point (0, 0, 1) is 1 / sqrt(2) before it, 0.707 m, and (0, 0, 2.5) is 0.354 m behind."""
    columns = np.indices(SIZE)[1] + 0.5
    depths = 2 / (1 - (columns - 33.0) / 50.0)  # z = 2 + x with x = z (u - 33) / 50
    planes, flat = planes_of(depths, 0.1)
    assert flat[:, :50].all()
    middle = planes[20, 32]
    a = 50.0 * middle[1]
    assert middle[2] == pytest.approx(0)
    assert a / np.hypot(a, middle[0]) == pytest.approx(-(0.5**0.5), abs=0.01)
    for z, expected, share in ((1.0, 0.5**0.5, 1), (2.5, -0.5 * 0.5**0.5, 1 - 0.5 * 0.5**0.5)):
        camera_from_world = np.eye(4)
        camera_from_world[2, 3] = z
        sums, weights = np.zeros((2, 1, SIDE, SIDE, SIDE), np.float32)
        block, lens = np.zeros((1, 3), np.int64), np.array([50.0, 52.0, 33.0, 20.0])
        integrate(sums, weights, block, 0.001, 1.0, planes, np.ones(SIZE), camera_from_world, lens, 0, 1)
        assert sums[0, 0, 0, 0] / weights[0, 0, 0, 0] == pytest.approx(expected, abs=1e-3)
        # The cosine of 45 degrees, and what is left of it behind the surface.
        assert weights[0, 0, 0, 0] == pytest.approx(0.5**0.5 * share, abs=1e-3)


def test_a_pixel_between_near_and_far_is_on_no_surface_and_a_slanted_one_is() -> None:
    depths = np.full((5, 8), 1.0)
    depths[:, 4] = 2.0  # one column between 1 m and 3 m
    depths[:, 5:] = 3.0
    depths[2, 1] = 0.0
    _, flat = planes_of(depths, 0.1)
    assert flat[0].tolist() == [True] * 4 + [False] + [True] * 3
    assert not flat[2, 1]
    slanted = 1 / (1 - 0.11 * np.arange(8.0))  # 1 to 4.3 m
    assert planes_of(np.tile(slanted, (5, 1)), 0.01)[1][:, 1:-1].all()


def test_a_plane_at_two_metres_gives_vertices_within_half_a_voxel() -> None:
    pytest.importorskip("skimage")
    from semgs.mesh.surface import surface_of

    poses = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    poses[1, 0, 3] = 0.25
    cameras = Cameras(poses, K.expand(2, 3, 3), SIZE)
    maps = [DepthMap(cameras[view], np.full(SIZE, 2.0), np.ones(SIZE)) for view in range(2)]
    vertices, faces = surface_of(fuse(maps, 0.05))
    assert np.abs(vertices[:, 2] - 2).max() < 0.025
    # The first camera sees x from 2 (0 - 33) / 50 = -1.32, and the second up to 0.25 + 2 (64 - 33) / 50 = 1.49.
    assert vertices[:, 0].min() == pytest.approx(-1.32, abs=0.1)
    assert vertices[:, 0].max() == pytest.approx(1.49, abs=0.1)
    assert len(np.unique(vertices, axis=0)) == len(vertices)
    one, two, three = (vertices[faces[:, corner]] for corner in range(3))
    across = np.cross(two - one, three - one)
    assert (across[:, 2] < 0).all()  # towards the cameras
    area = np.ptp(vertices[:, 0]) * np.ptp(vertices[:, 1])
    assert np.linalg.norm(across, axis=1).sum() / 2 == pytest.approx(area, rel=1e-3)  # no hole, nothing twice


def sphere(cameras: Cameras, radius: float) -> list[DepthMap]:
    """What cameras see of a sphere around the origin."""
    rays = back_project(torch.ones(*cameras.batch, *cameras.size, dtype=torch.float64), cameras)
    eyes = cameras.centres[:, None, None]
    rays = (rays - eyes).numpy()
    eyes = eyes.numpy()
    a, b, c = (rays**2).sum(-1), (rays * eyes).sum(-1), (eyes**2).sum(-1) - radius**2
    inside = b**2 - a * c
    depths = np.where(inside > 0, (-b - np.sqrt(np.maximum(inside, 0))) / a, 0)
    return [DepthMap(cameras[view], depth, np.ones(cameras.size)) for view, depth in enumerate(depths)]


def around(yaws: tuple[float, ...]) -> Cameras:
    """Cameras 2 m from the origin, which look at it."""
    eyes = [(-2 * np.cos(np.radians(yaw)), -2 * np.sin(np.radians(yaw)), 0.0) for yaw in yaws]
    poses = torch.stack([pose(yaw, eye, 0.0) for yaw, eye in zip(yaws, eyes, strict=True)])
    return Cameras(
        poses, torch.tensor([[150.0, 0, 50], [0, 150, 50], [0, 0, 1]]).double().expand(len(yaws), 3, 3), (100, 100)
    )


def test_a_sphere_has_its_radius_and_the_side_that_no_camera_sees_stays_open() -> None:
    pytest.importorskip("skimage")
    from semgs.mesh.surface import surface_of

    vertices, faces = surface_of(fuse(sphere(around((0.0, 90.0, 180.0, 270.0)), 0.5), 0.02))
    radii = np.linalg.norm(vertices, axis=1)
    assert abs(np.median(radii) - 0.5) < 0.005  # a quarter of a voxel
    assert np.mean(np.abs(radii - 0.5) < 0.02) > 0.99
    vertices, faces = surface_of(fuse(sphere(around((-15.0, 15.0)), 0.5), 0.02))
    assert np.abs(np.linalg.norm(vertices, axis=1) - 0.5).max() < 0.02
    # The cameras are at x < 0. They see tangents at 75.5 degrees from their directions, so nothing further than 90.5 from -x: x < 0.005.
    assert vertices[:, 0].max() < 0.02
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert set(counts) == {1, 2}  # open, and no edge has more than two faces


def test_too_many_voxels_are_refused_before_memory_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = Cameras(torch.eye(4).double(), K, SIZE)
    wide = DepthMap(camera, np.full(SIZE, 300.0), np.ones(SIZE))
    monkeypatch.setattr(fusion, "MOST_BLOCKS", 5000)
    with pytest.raises(
        ValueError, match=r"voxels of 0\.02 are too small for a scene of this size: more than 2,560,000"
    ):
        fuse([wide], 0.02)
    with pytest.raises(ValueError, match="use a larger --voxel"):
        fuse([wide], 1e-9)
