import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

pytest.importorskip("embreex")

from semgs.data.tables.classes import IGNORE
from semgs_rooms.assets.asset_library import Library, open_library
from semgs_rooms.assets.catalogue import read_catalogue
from semgs_rooms.assets.coverings import Coverings, UsedAssets
from semgs_rooms.assets.swaps import RULES, Rule, Swaps, fit_scale
from semgs_rooms.drawing.room import build_room
from semgs_rooms.drawing.shading import look
from semgs_rooms.pieces import fittings, furniture, openings
from semgs_rooms.pieces import materials as m
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.picture_kernels import PANORAMA, VIEW
from semgs_rooms.pieces.solids import SHELL, Piece, block
from semgs_rooms.pieces.texture_kernels import KIND, MAPPING, PICTURE
from semgs_rooms.sets.room_stream import generator, sample


@pytest.fixture(scope="module")
def library(asset_folder):
    return Library(asset_folder, "training", check=False)


def swaps(library, seed=0):
    rng, used = np.random.default_rng(seed), UsedAssets()
    return Swaps(rng, library, Coverings(rng, library, used), share=1.0)


@pytest.mark.long
def test_a_mesh_that_stands_in_stays_in_the_footprint_and_keeps_the_name(library):
    exchanged = 0
    for seed in range(15):
        for maker in (furniture.chair, furniture.bed, furniture.desk, furniture.sofa, furniture.dining_table):
            piece = maker(np.random.default_rng(seed))
            own = swaps(library, seed)(piece)
            assert (own.name, own.size) == (piece.name, piece.size)
            if own is piece:
                continue
            exchanged += 1
            for part in own.parts:
                assert part.shape == SHELL
                corners = part.shell.corners.reshape(-1, 3) + np.array(part.centre)
                assert corners.min() > -1e-5
                assert (corners[:, :2] <= np.array(piece.size[:2]) + 1e-5).all()
    assert exchanged > 25


def test_no_mesh_is_stretched_beyond_its_rule(asset_folder):
    rng = np.random.default_rng(3)
    for row in read_catalogue(asset_folder).meshes:
        rule = Rule(row.label, low=0.8, high=1.2, stretch=1.1)
        for _ in range(50):
            box = np.array(row.extents) * rng.uniform(0.5, 2.0, 3)
            scale = fit_scale(row, box, rule)
            if scale is not None and row.mount == "floor":
                assert scale.max() / scale.min() <= 1.1**2 + 1e-9
                assert scale.min() >= 0.8 / 1.1
                assert scale.max() <= 1.2 * 1.1 + 1e-9


def test_pieces_of_one_make_are_exchanged_for_one_mesh(library):
    swap, chair = swaps(library), furniture.chair(np.random.default_rng(1))
    assert swap(chair) is swap(Piece(chair.name, chair.size, chair.parts))


def test_parts_of_a_mesh_have_the_class_that_the_catalogue_gives_them(library):
    """The tests' desks carry a thing that is clutter."""
    swap = swaps(library)
    found = [swap(furniture.desk(np.random.default_rng(seed))) for seed in range(20)]
    labels = [{part.label for part in piece.parts if part.shape == SHELL} for piece in found]
    assert {LABEL["desk"], IGNORE} in labels


def brute_force(corners: np.ndarray, origin: np.ndarray, way: np.ndarray) -> int:
    """The triangle that a ray meets first, by Moeller and Trumbore's equations."""
    e, f = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(way, f)
    determinant = (e * p).sum(-1)
    determinant[np.abs(determinant) < 1e-12] = np.nan
    s = origin - corners[:, 0]
    u = (s * p).sum(-1) / determinant
    q = np.cross(s, e)
    v, t = (q * way).sum(-1) / determinant, (q * f).sum(-1) / determinant
    t[~((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-6))] = np.inf
    return int(t.argmin())


@pytest.mark.long
def test_labels_of_mesh_pixels_are_those_of_a_second_ray_caster(library):
    """Rays from the middle of rooms with meshes; triangles are put together anew from the plan's parts."""
    rng, met = np.random.default_rng(5), 0
    for index in range(10):
        room = build_room(generator(11, index), library)
        shells = [part for part in room.plan.parts if part.shell is not None]
        if not shells:
            continue
        corners, labels = [], []
        for part in shells:
            cosine, sine = np.cos(part.yaw), np.sin(part.yaw)
            turn = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
            corners.append(part.shell.corners @ turn.T + np.array(part.centre))
            labels += [part.label] * len(part.shell.corners)
        solid = room.caster.cast
        corners = np.concatenate(corners)
        pose = np.eye(4)
        pose[:3, 3] = (0.0, 0.0, 1.5)
        targets = corners[rng.integers(0, len(corners), 60)].mean(axis=1) + rng.normal(0, 0.02, (60, 3))
        ways = targets - pose[:3, 3]
        triangles, _ = solid(np.broadcast_to(pose[:3, 3], ways.shape), ways)
        seen, _ = look(room, pose, ways)
        for way, triangle, label in zip(ways, triangles, seen, strict=True):
            if triangle >= room.shells.first:
                met += 1
                assert label == labels[brute_force(corners, pose[:3, 3], way)]
    assert met > 60


def test_the_same_arguments_give_the_same_bits_from_another_library_and_after_pickling(asset_folder, library):
    arguments = {"size": (24, 32), "contexts": 2, "targets": 1}
    first = sample(11, 0, library=library, **arguments)
    sample(11, 5, library=library, **arguments)
    travelled = pickle.loads(pickle.dumps(library))
    for other in (library, Library(asset_folder, "training", check=False), travelled):
        for one, two in zip(first, sample(11, 0, library=other, **arguments), strict=True):
            assert torch.equal(one.images, two.images)
            assert torch.equal(one.labels, two.labels)
            assert torch.equal(one.depths, two.depths)


def test_a_small_memory_changes_nothing_but_the_time(asset_folder, library):
    small = Library(asset_folder, "training", check=False, memory=1)
    one = sample(11, 1, library=library, size=(24, 32), contexts=1, targets=0)[0]
    two = sample(11, 1, library=small, size=(24, 32), contexts=1, targets=0)[0]
    assert torch.equal(one.images, two.images)


@pytest.mark.long
def test_furniture_stands_where_it_stood_without_assets(library):
    """The last footprints, at most seven, are those of small things on the floor."""
    for index in range(8):
        plain, furnished = build_room(generator(11, index)), build_room(generator(11, index), library)
        assert furnished.plan.size == plain.plan.size
        assert furnished.plan.windows == plain.plan.windows
        count = len(plain.plan.footprints) - 7
        for one, two in zip(furnished.plan.footprints[:count], plain.plan.footprints[:count], strict=True):
            np.testing.assert_array_equal(one, two)


@pytest.mark.long
def test_about_half_of_the_homes_have_meshes_and_all_name_the_files_they_use(library):
    rooms = [build_room(generator(12, index), library) for index in range(30)]
    share = np.mean([len(room.shells.corners) > 0 for room in rooms])
    assert 0.25 < share < 0.75
    names = {row.file for row in (*library.meshes, *library.images)}
    assert all(set(room.files) <= names for room in rooms)
    for room in rooms:
        assert bool(len(room.shells.corners)) == any(file.startswith("models/") for file in room.files)
        assert (room.solids.materials[:, KIND] == PICTURE).sum() == 0 or room.files


@pytest.mark.long
def test_every_window_shows_a_picture_of_what_is_outside(library):
    for index in range(20):
        room = build_room(generator(13, index), library)
        panes = [row for row in room.solids.materials if row[KIND] == PICTURE and row[MAPPING] in (PANORAMA, VIEW)]
        assert len(panes) >= len(room.plan.windows)


def test_only_what_is_an_own_part_of_a_mesh_is_a_shell(library):
    own = swaps(library)
    box = Piece("rug", (1.0, 1.0, 0.01), (block(IGNORE, m.rug(np.random.default_rng(0)), (0, 0, 0), (1, 1, 0.01)),))
    assert own(box) is box
    assert "rug" not in RULES


def test_assets_in_the_home_folder(asset_folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HOME", str(asset_folder.parent))
    assert Library(f"~/{asset_folder.name}", "training", check=False).folders == (asset_folder,)


def test_splits_have_no_mesh_and_no_picture_in_common(asset_folder):
    libraries = [Library(asset_folder, split, check=False) for split in ("training", "validation", "other")]
    for kind in ("meshes", "images"):
        names = [{row.name for row in getattr(library, kind)} for library in libraries]
        assert all(names)
        assert not names[0] & names[1]
        assert not (names[0] | names[1]) & names[2]


def test_the_style_chooses_the_split_and_there_is_no_other_style(asset_folder):
    assert open_library(asset_folder, "home", check=False).split == "training"
    assert open_library(asset_folder, "other", check=False).split == "other"
    with pytest.raises(ValueError, match="plain"):
        open_library(asset_folder, "plain", check=False)


@pytest.fixture
def hung_library(tmp_path, write_mesh, box_mesh):
    """A folder of one picture frame with a canvas, and one kitchen cabinet."""
    folder, rows = tmp_path / "assets", []

    def row(name, label, subtype, mount, size, nodes):
        write_mesh(folder / f"{name}.glb", nodes)
        rows.append(
            {
                "name": name, "class": label, "subtype": subtype, "file": f"{name}.glb", "extents_m": size, "mount": mount,
                "textured": False, "licence": "CC0-1.0", "source_repo": "s", "commit": "c", "path": "p",
            }
        )  # fmt: skip

    frame = box_mesh((0.6, 0.03, 0.5))
    inner, _, uv = box_mesh((0.5, 0.02, 0.4))
    canvas = (inner + np.array([0, -0.02, 0.05], np.float32))[8:12], np.array([[0, 1, 2], [0, 2, 3]]), uv[8:12]
    row(
        "aa_frame_1",
        "picture",
        "picture",
        "wall",
        [0.6, 0.045, 0.5],
        {"n0_frame": (*frame, (0.2, 0.1, 0.1)), "n1_canvas": (*canvas, (1.0, 1.0, 1.0))},
    )
    body, top = box_mesh((1.5, 0.6, 0.86)), box_mesh((1.5, 0.6, 0.04))
    lifted = top[0] + np.array([0, 0, 0.86], np.float32)
    row(
        "aa_run_1",
        "counter",
        "kitchen_base_cabinet",
        "floor",
        [1.5, 0.6, 0.9],
        {
            "n0_mesh": (
                np.concatenate((body[0], lifted)),
                np.concatenate((body[1], top[1] + 24)),
                np.concatenate((body[2], top[2])),
                (0.5, 0.5, 0.5),
            )
        },
    )
    (folder / "catalog.json").write_text(json.dumps(rows))
    (folder / "textures.json").write_text("[]")
    return Library(folder, check=False)


def test_kitchen_cabinets_are_cabinets_below_their_top(hung_library):
    panels = hung_library.panels(next(row for row in hung_library.meshes if row.label == "counter"))
    heights = {panel.label: panel.shell.corners[..., 2] for panel in panels}
    assert heights.keys() == {None, "cabinet"}
    assert heights[None].min() == pytest.approx(0.86, abs=1e-6)
    assert heights["cabinet"].max() == pytest.approx(0.86, abs=1e-6)
    found = [swaps(hung_library, seed)(fittings.island(np.random.default_rng(seed))) for seed in range(60)]
    islands = [piece for piece in found if piece.parts[0].shape == SHELL]
    assert islands
    assert {part.label for piece in islands for part in piece.parts} == {LABEL["counter"]}


def test_a_frame_shows_what_the_picture_showed_each_its_own(hung_library):
    make = openings.picture
    pieces = (make(np.random.default_rng(seed)) for seed in range(200))
    piece = next(p for p in pieces if len(p.parts) == 5 and abs(p.size[0] / p.size[2] - 1.2) < 0.1)
    other = replace(
        piece, parts=(*piece.parts[:-1], replace(piece.parts[-1], material=m.artwork(np.random.default_rng(9))))
    )
    swap = next(s for s in (swaps(hung_library, seed) for seed in range(50)) if s(piece).parts[0].shape == SHELL)
    for one in (piece, other):
        hung = swap(one)
        assert [part.shape == SHELL for part in hung.parts] == [True, False]
        assert (hung.parts[-1].material == one.parts[-1].material).all()
        assert all(part.label == LABEL["picture"] for part in hung.parts)
        frame, art = hung.parts
        assert art.size[0] == pytest.approx(frame.size[0] * 5 / 6, rel=1e-5)
        assert art.size[2] == pytest.approx(frame.size[2] * 4 / 5, rel=1e-5)
        assert art.centre[1] > frame.centre[1]
