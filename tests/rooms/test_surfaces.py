import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs.rooms import texture_kernels as t
from semgs.rooms.room import Room, build_room
from semgs.rooms.shading import Hits, centres, meet, parts_of, pixel_directions
from semgs.rooms.stream import generator
from semgs.rooms.surfaces import Surfaces, is_mirror, mean_colours, normals_of, survey, triangles_of

SIZE = (48, 60)
INTRINSICS = np.array([[41.0, 0, 30.5], [0, 46.0, 25.2], [0, 0, 1]])


@pytest.fixture(scope="module")
def room() -> Room:
    return build_room(generator(0, 1))


def seen_from_a_corner(room: Room) -> tuple[Hits, Surfaces]:
    x, y, z = room.plan.size
    forward = np.array([x, y, -1.2 * z])
    forward /= np.linalg.norm(forward)
    right = np.array([forward[1], -forward[0], 0]) / np.hypot(*forward[:2])
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack((right, np.cross(forward, right), forward))
    pose[:3, 3] = -x / 2 + 0.1, -y / 2 + 0.1, z - 0.1
    seen = meet(room, pose[:3, 3], pixel_directions(pose, INTRINSICS, centres(SIZE)), 1 / 43)
    return seen, survey(room, seen, mean_colours(room), pose, INTRINSICS, SIZE)


def test_a_large_plain_triangle_has_its_paint_for_a_mean_colour_and_what_shines_has_none(room):
    corners, means, materials = triangles_of(room), mean_colours(room), room.solids.materials[room.owners]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1) / 2
    shines = materials[:, t.EMISSION] > 0
    plain = (materials[:, t.KIND] == t.PLAIN) & ~shines & (areas > 0.1)
    assert plain.sum() > 10
    np.testing.assert_allclose(means[plain], materials[plain, t.COLOUR_A : t.COLOUR_A + 3], atol=1e-9)
    assert (means[shines] == 0).all()
    assert means.min() >= 0
    assert means.max() <= 1


def test_flat_colours_times_the_quotient_of_colours_are_the_textures(room):
    """Over a large part the quotient that brings the texture back is 1 in the mean, and exactly 1 where there is none."""
    seen, surfaces = seen_from_a_corner(room)
    inner = (np.linalg.norm(surfaces.normals, axis=-1) > 1 - 1e-9).ravel()
    parts = parts_of(room, seen)
    colours, means = surfaces.colours.reshape(-1, 3), surfaces.means.reshape(-1, 3)
    large = [part for part in np.unique(parts[inner]) if (inner & (parts == part)).sum() > 60]
    assert len(large) > 3
    for part in large:
        here = inner & (parts == part) & (means > 0).all(axis=1)
        if here.any():
            assert (colours[here] / means[here]).mean() == pytest.approx(1, abs=0.12), part


def test_normals_turn_to_the_camera_and_are_of_length_1_but_on_edges(room):
    seen, surfaces = seen_from_a_corner(room)
    lengths = np.linalg.norm(surfaces.normals, axis=-1)
    assert lengths.max() <= 1 + 1e-9
    assert (lengths > 1 - 1e-9).mean() > 0.5
    inner = (lengths > 1 - 1e-9).ravel() & ~is_mirror(room)[parts_of(room, seen)]
    assert ((surfaces.normals.reshape(-1, 3) * seen.directions).sum(-1)[inner] < 0).all()


def test_normals_of_a_room_point_out_of_its_parts(room):
    """At every corner of a solid's triangles the normal points away from the solid's middle, and has length 1."""
    corners = triangles_of(room)
    normals = normals_of(room, corners)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-9)
    whole = slice(0, room.shells.first)
    outwards = corners[whole] - room.solids.centres[room.owners[whole]][:, None]
    assert (normals[whole] * outwards).sum(-1).min() > -1e-9
