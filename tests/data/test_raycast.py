import builtins

import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs.data.raycast import Raycaster


def soup(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    corners = rng.normal(0, 2, (count, 1, 3)) + rng.normal(0, 0.8, (count, 3, 3))
    return corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3)


def moller_trumbore(vertices, faces, origin, direction) -> tuple[int, float]:
    """The nearest hit, by solving o + t d = a + u (b - a) + v (c - a) for every triangle."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    first, second = b - a, c - a
    normal = np.cross(np.broadcast_to(direction, second.shape), second)
    determinant = (first * normal).sum(-1)
    shift = origin - a
    u = (shift * normal).sum(-1) / determinant
    across = np.cross(shift, first)
    v = across @ direction / determinant
    t = (second * across).sum(-1) / determinant
    t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
    return (int(t.argmin()), float(t.min())) if np.isfinite(t.min()) else (-1, np.inf)


def test_rays_hit_the_triangles_that_brute_force_finds():
    vertices, faces = soup(80)
    rng = np.random.default_rng(1)
    origins, directions = rng.normal(0, 1, (400, 3)), rng.normal(0, 2, (400, 3))
    triangles, distances = Raycaster(vertices, faces).cast(origins, directions)
    expected = [moller_trumbore(vertices, faces, o, d) for o, d in zip(origins, directions, strict=True)]
    assert (
        triangles == [number for number, _ in expected]
    ).mean() >= 0.995  # float32 may differ on a triangle's border
    agree = triangles == np.array([number for number, _ in expected])
    np.testing.assert_allclose(distances[agree], np.array([t for _, t in expected])[agree], rtol=1e-4)
    assert 0.2 < (triangles >= 0).mean() < 0.98


def test_a_ray_gets_to_the_end_of_its_reach_only_if_nothing_is_before_it():
    vertices, faces = np.array([[2.0, -1, -1], [2, 1, -1], [2, 0, 3]]), np.array([[0, 1, 2]])
    caster = Raycaster(vertices, faces)
    origins, directions = np.zeros((3, 3)), np.array([[1.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert caster.reached(origins, directions, np.array([1.9, 2.1, 50.0])).tolist() == [True, False, True]
    triangles, distances = caster.cast(origins, directions, np.array([1.9, 2.1, 50.0]))
    assert triangles.tolist() == [-1, 0, -1]
    assert distances.tolist() == pytest.approx([np.inf, 2.0, np.inf], rel=1e-6)  # how Embree rounds depends on the CPU


def test_no_rays_give_no_hits():
    caster = Raycaster(*soup(2))
    triangles, distances = caster.cast(np.zeros((0, 3)), np.zeros((0, 3)))
    assert len(triangles) == len(distances) == len(caster.reached(np.zeros((0, 3)), np.zeros((0, 3)))) == 0


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((3, 3)), np.zeros((0, 3), int), "no triangle"),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]]), "not finite"),
        (np.zeros((3, 3)), np.array([[0, 1, 3]]), r"0\.\.2"),
    ],
)
def test_a_mesh_that_cannot_be_is_refused(vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        Raycaster(vertices, faces)


def test_without_embree_the_extra_is_named(monkeypatch):
    genuine = builtins.__import__

    def without(name, *rest, **named):
        if name.startswith("embreex"):
            raise ImportError(name)
        return genuine(name, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"pip install -e '\.\[raycast\]'"):
        Raycaster(*soup(1))
