from __future__ import annotations

from dataclasses import replace
from math import cos, degrees, radians, sin

import pytest
import torch

from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians, move_cameras, move_gaussians
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.model.weights.load import load
from semgs.scene.own_views import lines, own_colours
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Cues, Up, in_own_frame, up_of, upright

DOWN = 30.0
"""Pitch of the cameras below the horizon [degrees]."""


def looking(yaw: float, roll: float = 0.0) -> torch.Tensor:
    """World (z up) from a camera at (1, 2, 1.5) that looks `DOWN` degrees down, at a yaw from x towards y [degrees]."""
    a, p, r = radians(yaw), radians(-DOWN), radians(roll)
    forward = torch.tensor([cos(a) * cos(p), sin(a) * cos(p), sin(p)], dtype=torch.float64)
    right = torch.tensor([sin(a), -cos(a), 0.0], dtype=torch.float64)
    down = torch.linalg.cross(forward, right)
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = torch.stack((cos(r) * right + sin(r) * down, cos(r) * down - sin(r) * right, forward), 1)
    pose[:3, 3] = torch.tensor([1.0, 2.0, 1.5])
    return pose


SIZE = (18, 24)
K = torch.tensor([[20.0, 0, 12.2], [0, 20, 8.3], [0, 0, 1]], dtype=torch.float64)


def scene_of(*poses: torch.Tensor, walls: bool = True, classes: bool = True, finer: int = 1) -> SavedScene:
    """A z-up scene of one Gaussian for each pixel: a floor at z = 0, and walls at x = 4 and y = 4.5. `finer` times as many pixels a side."""
    size = (finer * SIZE[0], finer * SIZE[1])
    k = torch.diag(torch.tensor([finer, finer, 1.0], dtype=torch.float64)) @ K
    cameras = Cameras(torch.stack(poses), k.expand(len(poses), 3, 3), size)
    rows, columns = torch.meshgrid(torch.arange(size[0]) + 0.5, torch.arange(size[1]) + 0.5, indexing="ij")
    pixels = torch.stack((columns, rows, torch.ones(size)), -1).double()
    rays = pixels @ torch.linalg.inv(k).T @ cameras.world_from_camera[:, None, :3, :3].mT
    planes = torch.tensor([[0, 0, 1, 0], [1, 0, 0, 4.0], [0, 1, 0, 4.5]], dtype=torch.float64)[: 3 if walls else 1]
    centres = cameras.centres[:, None, None]
    distances = torch.stack([(far - centres @ normal) / (rays @ normal) for normal, far in planes_of(planes)])
    nearest = torch.where(distances > 0, distances, torch.inf).min(0)
    means = (centres + nearest.values[..., None] * rays).flatten(0, 2)
    features = torch.full((len(means), 20), 0.4 / 19)
    number = torch.where(nearest.indices.flatten() == 0, SCANNET20.names.index("floor"), SCANNET20.names.index("wall"))
    features[torch.arange(len(means)), number] = 0.6
    quaternions = torch.tensor([1.0, 0, 0, 0]).expand(len(means), 4)
    shape = Appearance(quaternions, torch.full((len(means), 3), 0.01), torch.zeros(len(means), 1, 3))
    views = len(poses)
    return SavedScene(
        gaussians=Gaussians(means.float(), torch.full((len(means),), 0.9), shape, replace(shape, features=features) if classes else None),
        cameras=cameras, depths=torch.ones(views, *size), confidences=torch.ones(views, *size),
        depth_range=torch.tensor([0.5, 9.0], dtype=torch.float64).expand(views, 2), unit="metric", classes=SCANNET20 if classes else None,
        frames=tuple(map(str, range(views))), source="s", model="m", origin=(100.0, 0.0, -7.0),
    )  # fmt: skip


def planes_of(planes: torch.Tensor) -> list[tuple[torch.Tensor, float]]:
    """Normal and distance of each plane."""
    return [(plane[:3], float(plane[3])) for plane in planes]


def tilt(scene: SavedScene) -> tuple[SavedScene, torch.Tensor]:
    """The scene in a frame in which nothing is level, and the direction that is up there."""
    turn = torch.eye(4, dtype=torch.float64)
    turn[:3, :3] = matrix_from_quaternion(torch.tensor([0.5, -0.7, 0.3, 0.2], dtype=torch.float64))
    moved = replace(scene, gaussians=move_gaussians(turn, scene.gaussians), cameras=move_cameras(turn, scene.cameras))
    return moved, turn[:3, 2]


def off_degrees(found: torch.Tensor, true: torch.Tensor) -> float:
    return degrees(torch.acos((found @ true).clamp(-1, 1)).item())


@pytest.mark.parametrize("classes", [True, False])
def test_floor_and_walls_say_which_way_is_up_whatever_the_pitch(classes: bool) -> None:
    scene, up = tilt(scene_of(looking(40, roll=4), looking(46, roll=-2), classes=classes))
    mean = -scene.cameras.world_from_camera[:, :3, 1].sum(0)
    assert off_degrees(mean / mean.norm(), up) > 29, "the mean up is tilted by the pitch"
    found = up_of(scene)
    assert found.certain
    assert off_degrees(found.direction, up) < 1.5, "the mean roll of 1 degree may be taken for level"


@pytest.mark.parametrize("walls", [True, False])
def test_cameras_that_look_in_opposite_directions_say_which_way_is_up(walls: bool) -> None:
    """The axes to the right of a front and a rear camera cancel to the bit; nothing was left but NaN."""
    front, rear = looking(40), looking(40)
    rear[:2, :3] = -rear[:2, :3]  # half a turn about z
    assert (front[:3, 0] + rear[:3, 0]).abs().max() == 0
    found = up_of(scene_of(front, rear, walls=walls))
    assert off_degrees(found.direction, torch.tensor([0.0, 0, 1], dtype=torch.float64)) < 1.5


@pytest.mark.parametrize("upside_down", [0, 1])
def test_a_camera_that_hangs_upside_down_does_not_undo_the_other(upside_down: int) -> None:
    """Their own up directions cancel; the scene is upright or upside down by the first, and level in any case."""
    poses = [looking(40), looking(40)]
    poses[upside_down][:3, :2] = -poses[upside_down][:3, :2]  # half a turn about its axis
    found = up_of(scene_of(*poses))
    assert off_degrees(found.direction.abs(), torch.tensor([0.0, 0, 1], dtype=torch.float64)) < 3


@pytest.mark.parametrize("at_once", [1, 10_000])
def test_how_many_directions_are_scored_at_a_time_decides_nothing(
    at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, _ = tilt(scene_of(looking(40, roll=4), looking(46, roll=-2)))
    usual = up_of(scene).direction
    monkeypatch.setattr("semgs.scene.upright.DIRECTIONS", at_once)
    assert torch.allclose(up_of(scene).direction, usual, atol=1e-12)


def test_surfaces_that_fit_no_direction_leave_it_uncertain() -> None:
    scene = scene_of(looking(0), looking(6))
    noise = torch.randn(len(scene.gaussians), 3, generator=torch.Generator().manual_seed(2))
    scattered = replace(scene, gaussians=replace(scene.gaussians, means=scene.gaussians.means + 30 * noise))
    assert not up_of(scattered).certain


def cues_of(normals: torch.Tensor, floor: torch.Tensor) -> Cues:
    """Surfaces alone, those of the floor marked."""
    nothing = torch.zeros(0, 3, dtype=torch.float64)
    return Cues(
        nothing, normals, torch.ones(len(normals), dtype=torch.bool), ~floor, nothing, torch.eye(3, dtype=torch.float64)
    )


def test_most_surfaces_or_a_level_floor_confirm_a_direction() -> None:
    """Of 100 surfaces some are 10 degrees from level, which is within 15, and the others at 45 degrees, which is neither level nor upright."""

    def normal(degrees_off: float) -> list[float]:
        return [sin(radians(degrees_off)), 0.0, cos(radians(degrees_off))]

    def confirmed(level: int, floor: int = 0, off: float = 10.0) -> bool:
        normals = torch.tensor(
            [normal(off)] * floor + [normal(10)] * (level - floor) + [normal(45)] * (100 - level), dtype=torch.float64
        )
        normals[::2] *= -1  # a normal has no sign
        return cues_of(normals, torch.arange(100) < floor).confirm(torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))

    assert confirmed(60)
    assert not confirmed(59)
    assert confirmed(30, floor=5)
    assert not confirmed(30, floor=5, off=16)
    assert not confirmed(30, floor=5, off=88), "upright is not level"
    assert not cues_of(torch.zeros(0, 3, dtype=torch.float64), torch.zeros(0, dtype=torch.bool)).confirm(
        torch.ones(3, dtype=torch.float64)
    )


@pytest.mark.parametrize(("up", "expected"), [("x", [1, 0, 0]), ("-y", [0, -1, 0]), ("z", [0, 0, 1])])
def test_a_given_direction_is_taken(up: Up, expected: list[int]) -> None:
    assert up_of(scene_of(looking(0), looking(25)), up).direction.tolist() == expected


def test_files_have_the_first_view_forward_and_the_middle_at_the_origin() -> None:
    scene = scene_of(looking(20), looking(45))
    c, s = cos(radians(DOWN)), sin(radians(DOWN))
    for axes, forward, down in (
        ("-y", [0, s, c], [0, c, -s]),
        ("y", [0, -s, -c], [0, -c, s]),
        ("z", [c, 0, -s], [-s, 0, -c]),
    ):
        found = upright(scene, axes, "z")
        pose = found.scene.cameras.world_from_camera[0]
        assert torch.allclose(pose[:3, 2], torch.tensor(forward, dtype=torch.float64), atol=1e-9)
        assert torch.allclose(pose[:3, 1], torch.tensor(down, dtype=torch.float64), atol=1e-9)
        assert found.scene.gaussians.means.median(0).values.abs().max() < 1e-5
        assert torch.linalg.det(found.file_from_source[:3, :3]).item() == pytest.approx(1)


def test_the_matrix_takes_the_sources_coordinates_to_the_files() -> None:
    scene, _ = tilt(scene_of(looking(0), looking(25)))
    found = upright(scene, "z")
    in_source = torch.cat(
        (scene.gaussians.means.double() + torch.tensor(scene.origin), torch.ones(len(scene.gaussians), 1)), 1
    )
    assert torch.allclose(in_source @ found.file_from_source[:3].T, found.scene.gaussians.means.double(), atol=1e-5)
    assert found.scene.origin == (0, 0, 0)


def test_a_camera_that_looks_straight_down_still_has_a_forward() -> None:
    down = torch.eye(4, dtype=torch.float64)
    down[:3, :3] = torch.tensor(
        [[0, -1, 0], [-1, 0, 0], [0, 0, -1]], dtype=torch.float64
    )  # the top of its image is towards x
    down[:3, 3] = torch.tensor([1.0, 2.0, 1.5])
    found = upright(scene_of(down, down), "z", "z")
    assert torch.allclose(found.scene.cameras.world_from_camera[0, :3, 1], torch.tensor([-1.0, 0, 0]).double())


def striped(scene: SavedScene) -> SavedScene:
    """The scene with soft stripes on its walls, from floor to ceiling."""
    x, y, z = scene.gaussians.means.unbind(-1)
    stripes = (3 * torch.sin(10 * (x + y))).clamp(-1.7, 1.7) * (z > 0.01)
    colour = replace(scene.gaussians.colour, features=stripes[:, None, None].expand(-1, 1, 3))
    return replace(scene, gaussians=replace(scene.gaussians, colour=colour))


def bent(scene: SavedScene, degrees: float) -> SavedScene:
    """The scene as wrong depth would place it: the floor rises away from the first camera."""
    means, forward = scene.gaussians.means.clone(), scene.cameras.world_from_camera[0, :3, 2].float()
    means[:, 2] += sin(radians(degrees)) * (means @ forward)
    return replace(scene, gaussians=replace(scene.gaussians, means=means))


def test_upright_lines_correct_what_bent_surfaces_say() -> None:
    plain = scene_of(looking(40, roll=2), looking(46, roll=-1), finer=8)
    assert len(lines(plain)) == 0
    wrong, up = tilt(bent(plain, 8))
    assert off_degrees(up_of(wrong).direction, up) > 3
    right, up = tilt(bent(striped(plain), 8))
    assert off_degrees(up_of(right).direction, up) < 0.5


def test_a_stripe_on_a_wall_lies_in_the_plane_of_its_line() -> None:
    normals = lines(striped(scene_of(looking(40), finer=8)))
    assert len(normals) >= 4
    lengths = normals.norm(dim=-1)
    assert (lengths >= 8).all()
    upright_ones = (normals[:, 2].abs() / lengths) < sin(radians(0.3))
    assert upright_ones.double().mean() > 0.6


def test_an_edge_between_two_columns_is_a_line_between_them() -> None:
    scene = scene_of(looking(40), finer=8)
    dark = torch.arange(scene.cameras.size[1]).expand(scene.cameras.size).reshape(-1) < 90
    features = torch.where(dark[:, None, None], -1.5, 1.5).expand(-1, 1, 3)
    changed = replace(scene.gaussians, colour=replace(scene.gaussians.colour, features=features))
    (normal,) = lines(replace(scene, gaussians=changed)) @ scene.cameras.world_from_camera[0, :3, :3]
    k = scene.cameras.intrinsics[0]
    assert abs(normal[1] / normal[0]) < 1e-3, "it is parallel to the image's y axis"
    assert k[0, 2] - k[0, 0] * normal[2] / normal[0] == pytest.approx(90, abs=0.1)


def test_each_gaussian_has_the_colour_that_its_own_view_sees() -> None:
    scene = scene_of(looking(20), looking(65))
    features = torch.zeros(len(scene.gaussians), 4, 3)
    features[:, 3, 0] = 0.3  # red is 0.5 - 0.3 * 0.48860251 x of the direction
    changed = replace(scene.gaussians, colour=replace(scene.gaussians.colour, features=features))
    ways = scene.gaussians.means - torch.tensor([1.0, 2.0, 1.5])
    expected = 0.5 - 0.3 * 0.48860251 * ways[:, 0] / ways.norm(dim=-1)
    colours = own_colours(replace(scene, gaussians=changed))
    assert torch.allclose(colours[:, 0], expected, atol=1e-5)
    assert torch.allclose(colours[:, 1:], torch.tensor(0.5))


def test_the_scenes_own_frame_is_the_sources_up_to_the_origin() -> None:
    scene = scene_of(looking(0), looking(25))
    framed = in_own_frame(scene)
    assert framed.axes is None
    assert framed.source_from_file[:3, 3].tolist() == [100, 0, -7]
    assert framed.source_from_file[:3, :3].equal(torch.eye(3, dtype=torch.float64))


def test_a_direction_that_was_found_once_serves_every_file() -> None:
    scene, _ = tilt(scene_of(looking(0), looking(25)))
    found = up_of(scene)
    assert upright(scene, "y", found).file_from_source.equal(upright(scene, "y").file_from_source)


@pytest.mark.parametrize("turned", [False, True])
def test_up_of_the_demo_room_is_within_3_degrees(demo: SavedScene, turned: bool) -> None:
    scene, up = tilt(demo) if turned else (demo, torch.tensor([0, 0, 1.0], dtype=torch.float64))
    mean = -scene.cameras.world_from_camera[:, :3, 1].sum(0)
    assert off_degrees(mean / mean.norm(), up) > 3.5
    found = up_of(scene)
    assert found.certain
    assert off_degrees(found.direction, up) < 3


@pytest.fixture(scope="module")
def demo() -> SavedScene:
    """The included room from two views, by the included weights."""
    scene = open_scene(demo_scene())
    views = scene.read([2, 5], (240, 320))
    with torch.no_grad():
        return SavedScene.of(load("small")(views), views, unit="metric")
