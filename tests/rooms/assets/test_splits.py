from collections import Counter, defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semgs_rooms.assets.catalogue import EXCLUDED, read_catalogue, usable
from semgs_rooms.assets.splits import family, split_images, split_meshes

REAL = Path(__file__).parents[3].parent / "shared" / "assets"


def families(rows, split):
    found = defaultdict(set)
    for row in rows:
        found[family(row)].add(split[row.name])
    return found


def test_every_mesh_is_in_one_list_and_the_lists_are_about_60_20_and_20_per_cent(asset_folder):
    rows = read_catalogue(asset_folder).meshes
    split = split_meshes(rows)
    assert split.keys() == {row.name for row in rows}
    counts = Counter((row.label, split[row.name]) for row in rows)
    for label in {row.label for row in rows}:
        assert [counts[label, name] for name in ("training", "validation", "other")] == [3, 1, 1]


def test_lists_do_not_depend_on_the_order_of_the_rows(asset_folder):
    catalogue = read_catalogue(asset_folder)
    rng = np.random.default_rng(0)
    meshes, pictures = list(catalogue.meshes), list(catalogue.images)
    expected = split_meshes(meshes), split_images(pictures)
    rng.shuffle(meshes)
    rng.shuffle(pictures)
    assert (split_meshes(meshes), split_images(pictures)) == expected


def test_no_family_is_both_in_training_and_in_other(asset_folder):
    """Random makers whose families have up to nine pieces."""
    rows = read_catalogue(asset_folder).meshes
    rng = np.random.default_rng(1)
    for _ in range(20):
        many = []
        for row in rows:
            makers = [f"{row.name}{letter * int(rng.integers(1, 3))}" for letter in "xyz"]
            many += [replace(row, name=f"{rng.choice(makers)}_{k}") for k in range(int(rng.integers(1, 10)))]
        many = list({row.name: row for row in many}.values())
        split = split_meshes(many)
        for found in families(many, split).values():
            assert not {"training", "other"} <= found


def test_a_class_of_several_families_has_pieces_to_hold_out():
    pieces = read_and_name({"ig_shower_curtain": 6, "proc_shower_curtain": 8})
    assert set(split_meshes(pieces).values()) == {"training", "validation", "other"}


def read_and_name(counts):
    from semgs_rooms.assets.catalogue import MeshEntry

    blank = MeshEntry("", "shower curtain", "shower_curtain", "", (1.0, 0.1, 2.0), "ceiling")
    return [replace(blank, name=f"{stem}_{k}") for stem, count in counts.items() for k in range(count)]


def test_generated_pieces_are_one_family_a_class_and_never_held_out():
    """Everyone generates their own to train on, so none may be in the world by which choices are made, alone or with others."""
    generated = [replace(row, name=row.name.replace("ig", "bake")) for row in read_and_name({"ig_a_3": 9, "ig_b_4": 7})]
    assert {family(row) for row in generated} == {"bake shower curtain"}
    assert set(split_meshes(generated).values()) == {"training", "validation"}
    others = read_and_name({"ig_shower_curtain": 6, "proc_shower_curtain": 8})
    lists = split_meshes([*generated, *others])
    assert {lists[row.name] for row in generated} == {"training", "validation"}
    assert "other" in {lists[row.name] for row in others}


def test_pictures_of_each_kind_are_held_out(asset_folder):
    rows = read_catalogue(asset_folder).images
    split = split_images(rows)
    counts = Counter((row.kind, split[row.name]) for row in rows)
    for kind in {row.kind for row in rows}:
        assert [counts[kind, name] for name in ("training", "validation", "other")] == [3, 1, 1]


@pytest.mark.skipif(not REAL.is_dir(), reason="the folder of assets is not here")
def test_the_collected_assets_are_split_by_families_and_without_known_faults():
    everything = read_catalogue(REAL).meshes
    rows = [row for row in everything if usable(row)]
    split = split_meshes(rows)
    for found in families(rows, split).values():
        assert not {"training", "other"} <= found
    counts = Counter((row.label, split[row.name]) for row in rows)
    for label in {row.label for row in rows}:
        assert min(counts[label, name] for name in ("training", "validation", "other")) >= 1
    total = Counter(split.values())
    assert 0.5 < total["training"] / len(rows) < 0.65
    assert 0.15 < total["other"] / len(rows) < 0.3
    assert {row.name for row in everything} >= EXCLUDED
    assert not [row for row in rows if row.subtype == "stool"]
    left_out = [r for r in everything if r.name.startswith(("ig_sofa", "ig_armchair")) and not usable(r)]
    assert len(left_out) == 9
