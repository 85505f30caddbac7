"""Terms of data: by layout, through preparation, and of rooms."""

from __future__ import annotations

import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from semgs.data.demo_scene import demo_scene
from semgs.data.origin.licences import ATTRIBUTION, RECORD, ROOM, terms_of
from semgs.data.origin.terms import (  # fmt: skip
    FURNISHED,
    REPLICA,
    ROOMS,
    SCANNET,
    SCANNETPP,
    Terms,
    terms_from,
    terms_text,
)
from semgs.data.preparation.archive import Preparation, prepare_scene
from semgs.data.scenes import open_scene

SMALL = Preparation((24, 32), every=4)


@pytest.mark.parametrize(
    ("layout", "terms"),
    [("ScanNet", SCANNET), ("ScanNet++ dslr", SCANNETPP), ("ScanNet++ iphone", SCANNETPP), ("Replica", REPLICA)],
)
def test_a_prepared_scene_keeps_the_terms_of_its_source_however_often_it_is_prepared(
    tmp_path: Path, layout: str, terms: Terms
):
    scene = replace(open_scene(demo_scene()), layout=layout)
    assert terms_of(scene) == terms
    prepare_scene(scene, tmp_path / "once.zip", SMALL)
    prepare_scene(open_scene(tmp_path / "once.zip"), tmp_path / "twice.zip", replace(SMALL, every=1))
    assert terms_of(open_scene(tmp_path / "twice.zip")) == terms
    assert terms.own


def test_archives_of_older_versions_are_known_by_the_layout_of_their_source(tmp_path: Path):
    prepare_scene(replace(open_scene(demo_scene()), layout="ScanNet"), tmp_path / "new.zip", SMALL)
    with zipfile.ZipFile(tmp_path / "new.zip") as new, zipfile.ZipFile(tmp_path / "old.zip", "w") as old:
        for name in new.namelist():
            content = new.read(name)
            if name == RECORD:
                record = json.loads(content)
                del record["terms"]
                content = json.dumps(record).encode()
            old.writestr(name, content)
    assert terms_of(open_scene(tmp_path / "old.zip")) == SCANNET


def test_rooms_are_known_by_their_files_and_those_with_assets_by_their_attribution(tmp_path: Path):
    folder = tmp_path / "set" / "scene_00000"
    shutil.copytree(demo_scene(), folder)
    (folder / ROOM).unlink(missing_ok=True)
    assert terms_of(open_scene(folder)) == Terms("scenes of layout transforms.json: terms not known to semgs")
    (folder / ROOM).write_text('{"kind": "kitchen"}')
    assert terms_of(open_scene(folder)) == ROOMS
    (folder / ROOM).write_text('{"assets": ["models/a.glb"]}')
    assert terms_of(open_scene(folder)) == FURNISHED
    (folder / ROOM).write_text("{}")
    (folder.parent / ATTRIBUTION).write_text("# Attribution")
    assert terms_of(open_scene(folder)) == FURNISHED
    assert not ROOMS.own
    assert not FURNISHED.own


def test_terms_are_kept_once_each_in_their_order():
    assert terms_from(terms_text([SCANNET, ROOMS, SCANNET])) == (SCANNET, ROOMS)
