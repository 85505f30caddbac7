"""What holds in every room, on a few seeds here and on 200 under `long`."""

import itertools

import numpy as np
import pytest
import torch

pytest.importorskip("embreex")

from semgs.data.tables.classes import SCANNET20
from semgs.geometry.cameras import back_project, project
from semgs_rooms.drawing.room import FLAT, build_room
from semgs_rooms.drawing.shading import look, pixel_directions
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.solids import BALL, BOX, CYLINDER, Solids, gather, triangulate
from semgs_rooms.plans.home import draw_home
from semgs_rooms.plans.worlds import draw_closeup
from semgs_rooms.sets.room_stream import generator, sample

SIZE = (18, 24)


def seeds(few: int):
    """Seeds 0 .. few - 1 as one case, and 200 as another that takes longer."""
    return pytest.mark.parametrize(
        "count", [few, pytest.param(200, marks=[pytest.mark.long, pytest.mark.timeout(3000)])]
    )


def reach(solids: Solids, which: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """How far parts [n] reach from their centres along unit axes [n a 3]; a cushion counts as its box."""
    own = np.abs(np.einsum("nak,nkj->naj", axes, solids.rotations[which])) * (solids.sizes[which] / 2)[:, None]
    shapes = solids.shapes[which][:, None]
    round_ = np.hypot(own[..., 0], own[..., 1])
    return np.where(
        shapes == BALL, np.sqrt((own**2).sum(-1)), np.where(shapes == CYLINDER, round_ + own[..., 2], own.sum(-1))
    )


def penetrations(solids: Solids, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """How deep parts are in each other at most [m], by separating axes; negative where they are apart."""
    a, b = solids.rotations[first].swapaxes(1, 2), solids.rotations[second].swapaxes(1, 2)
    crosses = np.cross(a[:, :, None], b[:, None]).reshape(-1, 9, 3)
    axes = np.concatenate((a, b, crosses), axis=1)
    lengths = np.linalg.norm(axes, axis=-1, keepdims=True)
    axes = axes / np.maximum(lengths, 1e-9)
    gap = np.abs(((solids.centres[second] - solids.centres[first])[:, None] * axes).sum(-1))
    depth = reach(solids, first, axes) + reach(solids, second, axes) - gap
    return np.where(lengths[..., 0] > 1e-6, depth, np.inf).min(axis=1)


def test_penetration_is_measured_as_by_hand():
    turn = np.eye(3)[None].repeat(2, 0)
    ones = np.ones((2, 3))

    def pair(centre, shape):
        solids = Solids(
            turn,
            np.array([[0, 0, 0], centre], float),
            ones,
            np.array([BOX, shape]),
            np.zeros(2, np.int64),
            np.zeros((2, 24)),
        )
        return penetrations(solids, np.array([0]), np.array([1]))[0]

    assert pair((0.9, 0.2, 0), BOX) == pytest.approx(0.1)
    assert pair((1.1, 0.2, 0), BOX) == pytest.approx(-0.1)
    assert pair((0.0, 0.0, 0.95), CYLINDER) == pytest.approx(0.05)


@pytest.mark.long
@seeds(15)
@pytest.mark.parametrize("draw", [draw_home, draw_closeup])
def test_no_two_pieces_intersect_by_more_than_1_cm(draw, count):
    for seed in range(count):
        plan = draw(np.random.default_rng(seed))
        solids = gather(plan.parts)
        half = (np.abs(solids.rotations) * (solids.sizes / 2)[:, None]).sum(-1)
        low, high = solids.centres - half, solids.centres + half
        pairs = []
        for (a, b), (c, d) in itertools.combinations(plan.pieces, 2):
            if (
                np.minimum(high[a:b].max(0), high[c:d].max(0)) - np.maximum(low[a:b].min(0), low[c:d].min(0)) > 0.01
            ).all():
                pairs.append(np.stack(np.meshgrid(np.arange(a, b), np.arange(c, d)), -1).reshape(-1, 2))
        if pairs:
            first, second = np.concatenate(pairs).T
            depths = penetrations(solids, first, second)
            worst = depths.argmax()
            named = [SCANNET20.names[i] if i < 20 else "ignored" for i in solids.labels[[first[worst], second[worst]]]]
            assert depths[worst] <= 0.01, f"seed {seed}: {named} {depths[worst]:.3f} m"


@seeds(15)
def test_nothing_stands_in_a_wall(count):
    """No furniture on the floor is inside a wall, a block or a partition by more than 1 cm."""
    for seed in range(count):
        plan = draw_home(np.random.default_rng(seed))
        solids = gather(plan.parts)
        placed = {part for a, b in plan.pieces for part in range(a, b)}
        walls = np.array([p for p in range(len(plan.parts)) if p not in placed and solids.labels[p] == LABEL["wall"]])
        things = np.array([p for p in sorted(placed) if solids.labels[p] not in (LABEL["door"], LABEL["window"])])
        first, second = np.stack(np.meshgrid(walls, things), -1).reshape(-1, 2).T
        assert penetrations(solids, first, second).max() <= 0.0101, seed


@pytest.mark.long
@seeds(10)
def test_cameras_keep_0_4_m_from_everything_but_the_ground(count):
    """Rays in all directions from every camera meet nothing nearer, and no camera is lower than 0.3 m."""
    rng = np.random.default_rng(0)
    ways = rng.normal(size=(600, 3))
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    for index in range(count):
        room = build_room(generator(3, index))
        for views in sample(3, index, size=(12, 16), contexts=2, targets=2):
            for centre in views.cameras.centres.numpy():
                triangles, distances = room.caster.cast(np.broadcast_to(centre, ways.shape), ways)
                assert (triangles >= 0).all()
                ground = centre[2] + distances * ways[:, 2] < FLAT
                assert distances[~ground].min() > 0.4
                assert centre[2] > 0.3


GRAZING = 1e-5


@seeds(4)
def test_labels_and_depths_are_those_that_a_slow_ray_caster_finds(count):
    """Every pixel's label is that of a triangle within 0.1 mm of the nearest one its ray meets, in float64."""
    for index in range(count):
        room = build_room(generator(4, index))
        corners, owners = triangulate(room.solids)
        views, _ = sample(4, index, size=SIZE, contexts=1, targets=0)
        pose, intrinsics = views.cameras.world_from_camera[0].numpy(), views.cameras.intrinsics[0].numpy()
        columns, rows = np.meshgrid(np.arange(SIZE[1]) + 0.5, np.arange(SIZE[0]) + 0.5)
        rays = np.stack(
            (
                (columns - intrinsics[0, 2]) / intrinsics[0, 0],
                (rows - intrinsics[1, 2]) / intrinsics[1, 1],
                np.ones(SIZE),
            ),
            -1,
        )
        labels, depths = views.labels[0].numpy(), views.depths[0].numpy()
        for row, column in np.ndindex(SIZE):
            way = pose[:3, :3] @ rays[row, column]
            # Where an edge passes within float32 rounding of the ray, the nearest surface is either that it borders.
            for aside in (np.zeros(3), *(GRAZING * np.concatenate((np.eye(3), -np.eye(3))))):
                found = slow_hits(corners, pose[:3, 3], way + aside)
                nearest = found.min()
                labelled = room.solids.labels[owners[found < nearest + 1e-4]]
                if abs(depths[row, column] - nearest) < 1e-4 * max(1.0, nearest) and labels[row, column] in labelled:
                    break
            else:
                pytest.fail(
                    f"room {index}, pixel {row}, {column}: {depths[row, column]} m, label {labels[row, column]}"
                )


def slow_hits(corners: np.ndarray, origin: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Distance at which a ray meets each triangle, in lengths of `way`; inf where it does not (Moeller and Trumbore)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    cross = np.cross(way, second)
    volume = (first * cross).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = origin - corners[:, 0]
        u = (shift * cross).sum(-1) / volume
        turned = np.cross(shift, first)
        v = turned @ way / volume
        distance = (second * turned).sum(-1) / volume
    near = 1e-5  # embree reckons in float32
    return np.where((u >= -near) & (v >= -near) & (u + v <= 1 + near) & (distance > 0), distance, np.inf)


@pytest.mark.long
@pytest.mark.timeout(3000)
def test_what_one_view_sees_lies_within_5_mm_on_the_surface_that_another_sees_in_200_rooms():
    for index in range(200):
        context, _ = sample(4, index, size=SIZE, contexts=2, targets=0)
        points = back_project(context.depths.double(), context.cameras)[0].reshape(-1, 3)
        pixels = project(points, context.cameras[1])
        x, y, z = pixels.unbind(-1)
        inside = ((z > 0.1) & (x > 0) & (y > 0) & (x < SIZE[1]) & (y < SIZE[0])).numpy()
        pose, intrinsics = context.cameras.world_from_camera[1].numpy(), context.cameras.intrinsics[1].numpy()
        _, depths = look(
            build_room(generator(4, index)), pose, pixel_directions(pose, intrinsics, pixels[:, :2].numpy()[inside])
        )
        gap = z.numpy()[inside] - depths
        assert gap.min() > -0.005  # on the surface, or behind what hides it
        assert (np.abs(gap) < 0.005).mean() > 0.3


@pytest.mark.long
@pytest.mark.timeout(3000)
def test_every_class_fills_0_3_percent_of_the_pixels_of_200_rooms():
    counts = torch.zeros(256, dtype=torch.long)
    for index in range(200):
        views, _ = sample(6, index, size=(48, 64), contexts=2, targets=0)
        counts += torch.bincount(views.labels.flatten().long(), minlength=256)
    shares = counts[:20] / counts.sum()
    assert shares.min() > 0.003, {
        name: round(float(share), 4) for name, share in zip(SCANNET20.names, shares, strict=True)
    }
