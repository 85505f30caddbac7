"""Generating with a stand-in for Infinigen: what is resumed, left out, refused, and what the folder is worth."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

pytest.importorskip("embreex")

from semgs.files.errors import InputError
from semgs_rooms.assets.asset_library import Library, open_library
from semgs_rooms.assets.catalogue import read_catalogue
from semgs_rooms.assets.lock import lock_digest, lock_of, verify
from semgs_rooms.furniture.generation import Generated, generate
from semgs_rooms.furniture.kinds import make_job

SEED = 3


def run(folder: Path, stand_in, pieces: int, **options) -> Generated:
    return generate(folder, SEED, pieces, environment=stand_in.folder, **options)


def tree(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.long
def test_the_folder_is_one_that_rooms_take(stand_in, tmp_path):
    made = run(tmp_path / "lib", stand_in, 3)
    assert (made.left_out, made.late) == ({}, {})
    catalogue = read_catalogue(tmp_path / "lib")
    assert [row.name for row in catalogue.meshes] == [row["name"] for row in made.rows]
    found = []
    for split in ("training", "validation"):
        library = Library(tmp_path / "lib", split)
        assert all(library.panels(row) for row in library.meshes)
        found += library.meshes
    assert sorted(row.name for row in found) == sorted(row.name for row in catalogue.meshes)
    with pytest.raises(InputError, match=r"split other, found none; what tools\.furniture makes is for training"):
        open_library(tmp_path / "lib", "other")


@pytest.mark.long
def test_pieces_do_not_depend_on_their_number_nor_on_interruptions_nor_on_workers(stand_in, tmp_path):
    run(tmp_path / "whole", stand_in, 4)

    def interrupt(count: int) -> None:
        if count == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path / "cut", stand_in, 4, done=interrupt)
    assert not (tmp_path / "cut" / "lock.json").exists()
    before = len(stand_in.calls)
    (tmp_path / "cut" / "work").mkdir()
    (tmp_path / "cut" / "work" / "bake_x.npz").write_bytes(b"left by a killed one")
    run(tmp_path / "cut", stand_in, 4)
    assert len(stand_in.calls) == before + 3
    run(tmp_path / "grown", stand_in, 2)
    run(tmp_path / "grown", stand_in, 4, workers=2)
    assert tree(tmp_path / "whole") == tree(tmp_path / "cut") == tree(tmp_path / "grown")
    with pytest.raises(ValueError, match="up to number 3, more than the 2 requested"):
        run(tmp_path / "grown", stand_in, 2)


@pytest.mark.parametrize(
    ("way", "reason"),
    [
        ("stray", "stray triangles"),
        ("hanging", "is detached"),
        ("error", "Infinigen: ValueError: cannot be made"),
        ("crash", "ended with -11"),
    ],
)
def test_an_incomplete_piece_is_left_out_and_not_tried_again(stand_in, tmp_path, way, reason):
    name = make_job(SEED, 0).name
    stand_in.goes_wrong(**{name: way})
    made = run(tmp_path / "lib", stand_in, 1)
    assert reason in made.left_out[name]
    assert made.rows == ()
    assert run(tmp_path / "lib", stand_in, 1).left_out == made.left_out
    assert stand_in.calls == [name]
    assert not list((tmp_path / "lib" / "models").iterdir())


@pytest.mark.long
def test_what_takes_too_long_is_ended_and_tried_again_by_the_next_call(stand_in, tmp_path):
    name = make_job(SEED, 1).name
    stand_in.goes_wrong(**{name: "slow"})
    made = run(tmp_path / "lib", stand_in, 2, limit=2.0)
    assert "not finished after 2 s" in made.late[name]
    assert {row["name"] for row in made.rows} == {make_job(SEED, 0).name}
    stand_in.goes_wrong()
    assert run(tmp_path / "lib", stand_in, 2).late == {}
    assert stand_in.calls.count(name) == 2


@pytest.mark.parametrize(("way", "found"), [("wrong", "faces refer to 1..1000000"), ("pickle", "allow_pickle=False")])
def test_wrong_output_is_refused(stand_in, tmp_path, way, found):
    stand_in.goes_wrong(**{make_job(SEED, 0).name: way})
    with pytest.raises(InputError, match=f"expected arrays of a generated piece, found .*{found}"):
        run(tmp_path / "lib", stand_in, 1)


def test_an_environment_that_does_not_start_is_told_at_once(stand_in, tmp_path):
    stand_in.goes_wrong(**{make_job(SEED, 0).name: "broken"})
    with pytest.raises(InputError, match=r"Infinigen starts, found .*libXi\.so\.6.*remove it"):
        run(tmp_path / "lib", stand_in, 3)
    assert len(stand_in.calls) == 1


def test_a_generated_folder_is_checked_against_its_own_lock(stand_in, tmp_path):
    folder = tmp_path / "lib"
    run(folder, stand_in, 2)
    assert lock_of(folder) == folder / "lock.json"
    first = lock_digest(folder)
    verify(folder)
    run(folder, stand_in, 3)
    assert lock_digest(folder) != first
    mesh = next((folder / "models").iterdir())
    mesh.write_bytes(mesh.read_bytes()[:-1] + b"?")
    with pytest.raises(InputError, match=f"1 altered: models/{mesh.name}"):
        Library(folder)


def test_folders_go_together_unless_they_have_files_of_one_name(stand_in, tmp_path, asset_folder):
    folder = tmp_path / "lib"
    run(folder, stand_in, 2)
    both = Library([asset_folder, folder], check=False)
    alone = Library(asset_folder, check=False), Library(folder, check=False)
    assert both.meshes == alone[0].meshes + alone[1].meshes
    assert both.images == alone[0].images
    for row in both.meshes:
        assert both.panels(row)
    assert both.lock_digests == (lock_digest(asset_folder), lock_digest(folder))
    with pytest.raises(InputError, match="file names that other folders do not use"):
        Library([folder, tmp_path / "lib" / ".." / "lib"], check=False)


def test_other_settings_and_other_folders_are_refused(stand_in, tmp_path):
    run(tmp_path / "lib", stand_in, 1)
    record = tmp_path / "lib" / "bake.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | {"seed": 9}))
    with pytest.raises(ValueError, match="seed is 9 there, not 3"):
        run(tmp_path / "lib", stand_in, 1)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "photo.jpg").write_bytes(b"")
    with pytest.raises(InputError, match="something else"):
        run(tmp_path / "mine", stand_in, 1)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["photo.jpg"]
