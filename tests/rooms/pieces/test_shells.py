import numpy as np
import pytest

from semgs_rooms.drawing.shading_kernels import barycentric
from semgs_rooms.pieces import shell_kernels as kernels
from semgs_rooms.pieces.solids import Shell, corner_normals, place_shells


def sphere(rows: int, columns: int) -> np.ndarray:
    rise = np.linspace(-np.pi / 2, np.pi / 2, rows + 1)
    turn = np.linspace(0, 2 * np.pi, columns + 1)

    def point(i, j):
        return np.cos(rise[i]) * np.cos(turn[j]), np.cos(rise[i]) * np.sin(turn[j]), np.sin(rise[i])

    triangles = []
    for i in range(rows):
        for j in range(columns):
            a, b, c, d = point(i, j), point(i, j + 1), point(i + 1, j + 1), point(i + 1, j)
            triangles += [t for t, whole in (((a, b, c), i > 0), ((a, c, d), i < rows - 1)) if whole]
    return np.array(triangles)


def test_a_fine_sphere_has_radial_normals():
    corners = sphere(16, 24)
    normals = corner_normals(corners)
    inner = (normals * corners).sum(-1)
    assert inner.min() > 0.99


def test_the_edges_of_a_box_stay_sharp(box_mesh):
    vertices, faces, _ = box_mesh((0.5, 0.8, 1.2))
    corners = vertices[faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=-1, keepdims=True)
    np.testing.assert_allclose(corner_normals(corners), np.repeat(flat[:, None], 3, axis=1), atol=1e-6)


def test_barycentric_weights_give_the_point_back():
    rng = np.random.default_rng(0)
    for _ in range(50):
        corners, (b, c) = rng.normal(size=(3, 3)), rng.uniform(-0.5, 1, 2)
        point = (1 - b - c) * corners[0] + b * corners[1] + c * corners[2]
        np.testing.assert_allclose(barycentric(corners, *point), (b, c), atol=1e-8)


def test_distances_to_points_are_those_of_the_nearest_one_up_to_the_reach():
    rng = np.random.default_rng(1)
    field, corner = np.full((14, 9, 11), 0.35), np.array([-0.4, 0.1, 0.3])
    points = corner + rng.uniform(-0.2, 1.2, (30, 3))
    kernels.distance_to_points(field, corner, 0.1, 0.35, points)
    nodes = corner + 0.1 * np.stack(np.meshgrid(*map(np.arange, field.shape), indexing="ij"), axis=-1)
    expected = np.linalg.norm(nodes[..., None, :] - points, axis=-1).min(axis=-1)
    np.testing.assert_allclose(field, np.minimum(expected, 0.35), atol=1e-9)


def test_scattered_points_leave_no_place_of_a_triangle_farther_than_the_spacing():
    rng = np.random.default_rng(2)
    corners = rng.uniform(-0.5, 0.5, (4, 3, 3))
    points = kernels.scatter(corners, 0.05)
    weights = rng.dirichlet((1, 1, 1), (4, 200))
    places = np.einsum("tnk,tkc->tnc", weights, corners).reshape(-1, 3)
    gaps = np.linalg.norm(places[:, None] - points[None], axis=-1).min(axis=1)
    assert gaps.max() < 0.09


def test_an_atlas_is_covered_where_pixel_centres_lie_in_triangles():
    uv = np.random.default_rng(3).uniform(0, 1, (5, 3, 2)).astype(np.float32)
    used = np.zeros((13, 20), np.float32)
    kernels.cover(uv, used)
    for row in range(13):
        for column in range(20):
            x, y = (column + 0.5) / 20, (row + 0.5) / 13
            inside = False
            for a, b, c in uv.astype(np.float64):
                sides = [(q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]) for p, q in ((a, b), (b, c), (c, a))]
                inside |= min(sides) >= 0 or max(sides) <= 0
            assert used[row, column] == inside


def test_placed_shells_are_turned_about_their_parts_middle():
    corners = np.array([[[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]]], np.float32)
    normals = np.tile(np.array([1, 0, 0], np.float32), (1, 3, 1))
    uv = np.array([[[0, 0], [0.5, 0], [0, 0.5]]], np.float32)
    turn = np.array([[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]])
    placed = place_shells([(0, Shell(corners, normals, uv))], turn, np.array([[1.0, 2, 3]]), first=7)
    np.testing.assert_allclose(placed.corners[0], [[1, 2.1, 3], [0.8, 2, 3], [1, 2, 3.3]], atol=1e-7)
    np.testing.assert_allclose(placed.normals[0, 0], (0, 1, 0), atol=1e-7)
    area = 0.5 * np.linalg.norm(np.cross(corners[0, 1] - corners[0, 0], corners[0, 2] - corners[0, 0]))
    assert placed.density[0] == pytest.approx(np.sqrt(0.125 / area), rel=1e-5)
    assert placed.first == 7
