"""From raw meshes to pieces: sizes, fronts, labels, colours, books, and what is no piece."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs_rooms.assets.glb import read_primitives
from semgs_rooms.furniture import surfaces as s
from semgs_rooms.furniture.books import books_on, compartments
from semgs_rooms.furniture.cloth import PATTERNS, cloth_picture
from semgs_rooms.furniture.finish import finish
from semgs_rooms.furniture.kinds import KINDS, Make, PieceJob
from semgs_rooms.furniture.raw import Incomplete, RawMesh, check_complete
from semgs_rooms.furniture.surfaces import Surface
from semgs_rooms.furniture.tints import Tint, apply_tints

RNG = np.random.default_rng


def job(kind: str, number: int = 0) -> PieceJob:
    return PieceJob(f"bake_{kind}_0_{number}", kind, number, 0, KINDS[kind].makes(RNG(number)))


def cuboid(low: tuple, high: tuple, name: str = "x") -> Surface:
    """A box between two corners."""
    corners = np.array([[(low, high)[k][a] for a, k in enumerate(bits)] for bits in np.ndindex(2, 2, 2)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = np.array([(q[0], q[k], q[k + 1]) for q in quads for k in (1, 2)])
    return Surface(name, corners, faces, np.zeros((8, 2)))


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_every_kind_becomes_pieces_of_real_sizes_that_read_back(kind, piece, usual_size, tmp_path):
    one = job(kind)
    meshes = [piece(make, size) for make, size in zip(one.makes, (usual_size(kind), [0.5, 0.4, 0.6]), strict=False)]
    for made in finish(one, meshes):
        row = made.row("x.glb", 1, "1")
        low, high = np.array(made.kind.low), np.array(made.kind.high)
        sides = np.array(row["extents_m"])
        assert (sides >= low - 2e-3).all()
        assert (sides <= high + 2e-3).all()
        assert row["class"] == KINDS[kind].label
        made.write(tmp_path / "x.glb")
        nodes = {primitive.name for primitive in read_primitives(tmp_path / "x.glb")}
        assert row.get("part_classes", {}).keys() <= nodes
        lowest, highest = s.box(made.surfaces)
        np.testing.assert_allclose([*(lowest + highest)[:2], lowest[2]], 0, atol=1e-9)


def test_what_looked_along_x_looks_to_the_front():
    nose = s.turn([cuboid((0.5, -0.1, 0), (1, 0.1, 1))])[0]
    lowest, highest = s.box([nose])
    np.testing.assert_allclose(lowest, (-0.1, -1, 0), atol=1e-12)
    np.testing.assert_allclose(highest, (0.1, -0.5, 1), atol=1e-12)
    (left,) = s.turn([cuboid((0, 0.5, 0), (0.1, 1, 1))])  # its left hand, +y, comes to lie at +x
    assert s.box([left])[0][0] == pytest.approx(0.5)


def test_a_piece_of_odd_proportions_is_none(piece):
    one = job("bathtub")
    with pytest.raises(Incomplete, match="is no size for a bathtub"):
        finish(one, [piece(one.makes[0], [0.8, 0.9, 0.6])])


@pytest.mark.parametrize(
    ("way", "reason"), [("", None), ("stray", "stray triangles"), ("hanging", "1/2|0.50 of its surface")]
)
def test_incomplete_pieces_are_recognised(piece, way, reason):
    mesh = piece(Make("", 1), [0.4, 0.8, 0.9], way)
    if reason is None:
        check_complete(mesh, KINDS["cabinet"])
    else:
        with pytest.raises(Incomplete, match=reason):
            check_complete(mesh, KINDS["cabinet"])


def test_a_piece_must_have_enough_triangles_a_size_and_a_body(piece):
    mesh = piece(Make("", 1), [0.4, 0.8, 0.9])
    with pytest.raises(Incomplete, match="12 triangles"):
        check_complete(
            replace(mesh, faces=mesh.faces[:12], uv=mesh.uv[:12], material=mesh.material[:12]), KINDS["cabinet"]
        )
    with pytest.raises(Incomplete, match=r"4\.00 m large"):
        check_complete(replace(mesh, vertices=mesh.vertices / np.float32(0.9) * np.float32(4)), KINDS["cabinet"])
    line = mesh.vertices * np.array([0.05, 0.05, 0.9], np.float32)
    diagonal = (line + np.linspace(0, 1, len(line), dtype=np.float32)[:, None] * [0.5, 0.7, 0]).astype(np.float32)
    with pytest.raises(Incomplete, match=r"hull fills|is detached"):
        check_complete(replace(mesh, vertices=diagonal), replace(KINDS["cabinet"], gap=9.0))


def test_kitchens_are_cabinets_below_a_counter_and_cabinets_on_the_wall():
    def block(low, high, material):
        surface = cuboid(low, high)
        return surface.vertices[surface.faces], np.full(12, material, np.int32)

    parts = [
        block((-0.3, -1, 0), (0.3, 0.2, 0.85), 0), block((-0.3, 0.2, 0), (0.3, 1, 0.85), 0),
        block((-0.32, -1, 0.85), (0.32, 1, 0.9), 1),
        block((-0.3, -1, 1.4), (0.1, 0, 2.1), 0), block((-0.3, 0, 1.4), (0.1, 1, 2.1), 0),
    ]  # fmt: skip
    corners = np.concatenate([p[0] for p in parts])
    count = len(corners)
    uv = RNG(0).random((count, 3, 2)).astype(np.float32)
    mesh = RawMesh(
        corners.reshape(-1, 3).astype(np.float32), np.arange(3 * count, dtype=np.int32).reshape(-1, 3), uv,
        np.concatenate([p[1] for p in parts]), ("shader_wood", "shader_marble"), np.full((16, 16, 3), 99, np.uint8),
    )  # fmt: skip
    base, wall = finish(job("kitchen"), [mesh])
    row = base.row("x", 1, "1")
    assert (row["class"], row["subtype"], row["part_classes"]) == (
        "counter",
        "kitchen_base_cabinet",
        {"n0_body": "cabinet"},
    )
    worktop = next(one for one in base.surfaces if one.name == "worktop")
    assert s.box([worktop])[0][2] > 0.8
    row = wall.row("x", 1, "1")
    assert (row["class"], row["mount"], wall.name) == ("cabinet", "wall", "bake_kitchen_0_0_wall")
    assert row["extents_m"][2] == pytest.approx(0.7, abs=0.01)


def test_books_stand_on_boards_between_uprights():
    shelf = s.merge(
        [
            cuboid((-0.5, -0.15, 0), (0.5, 0.15, 0.02)), cuboid((-0.5, -0.15, 0.4), (0.5, 0.15, 0.42)),
            cuboid((-0.5, -0.15, 0.8), (0.5, 0.15, 0.82)), cuboid((-0.5, -0.15, 0), (-0.48, 0.15, 0.82)),
            cuboid((0.48, -0.15, 0), (0.5, 0.15, 0.82)), cuboid((0.1, -0.15, 0), (0.12, 0.15, 0.82)),
        ]
    )  # fmt: skip
    found = np.array(sorted(compartments(shelf)))
    expected = [(x, y, z, z + 0.38) for x, y in ((-0.48, 0.1), (0.12, 0.48)) for z in (0.02, 0.42)]
    np.testing.assert_allclose(found, expected, atol=0.012)
    for seed in range(6):
        books = books_on(shelf, RNG(seed))
        corners = books.vertices.reshape(-1, 16, 3)
        low, high = corners.min(axis=1), corners.max(axis=1)
        inside = [
            (low > np.array([a, -0.15, board]) - 1e-9).all(axis=1)
            & (high < np.array([b, 0.15, roof]) + 1e-9).all(axis=1)
            for a, b, board, roof in expected
        ]
        assert np.any(inside, axis=0).all()
        assert books.uv.min() >= 0
        assert books.uv.max() <= 1


def test_what_nobody_sees_is_left_out():
    outer, inner = cuboid((0, 0, 0), (1, 1, 1)), cuboid((0.3, 0.3, 0.3), (0.7, 0.7, 0.7))
    assert len(s.remove_hidden(s.merge([outer, inner])).faces) == 12
    open_box = replace(outer, faces=outer.faces[2:])  # without one side one looks in
    assert len(s.remove_hidden(s.merge([open_box, inner])).faces) > 10


def test_materials_are_tinted_by_name_each_where_its_triangles_are(piece):
    triangles = np.array(
        [[[0, 0], [0.5, 0], [0.5, 1]], [[0, 0], [0.5, 1], [0, 1]], [[0.5, 0], [1, 0], [1, 1]]], np.float32
    )
    mesh = replace(
        piece(Make("", 1), [1, 1, 1]), uv=triangles, material=np.array([0, 0, 1], np.int32),
        faces=np.zeros((3, 3), np.int32), materials=("shader_Wood.001", "brushed_metal"),
        picture=np.full((40, 60, 3), (10, 90, 40), np.uint8),
    )  # fmt: skip
    result = apply_tints(mesh, [Tint(("metal",), (200, 201, 202), 0.5), Tint(("wood",), (120, 80, 40), 0.5)])
    np.testing.assert_allclose(result[20, 10], [120, 80, 40], atol=1)
    np.testing.assert_allclose(result[38, 55], [200, 201, 202], atol=1)
    kept = apply_tints(mesh, [Tint(("metal",), (200, 201, 202), 0.5)])
    assert kept[20, 10].tolist() == [10, 90, 40]


def test_pictures_of_cloth_follow_from_their_generator():
    pictures = [cloth_picture(RNG(seed), 1.3, 2.1) for seed in range(2 * len(PATTERNS))]
    assert len({picture.tobytes() for picture in pictures}) == len(pictures)
    np.testing.assert_array_equal(cloth_picture(RNG(5), 1.3, 2.1), pictures[5])
