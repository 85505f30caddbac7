import shutil
from pathlib import Path

import pytest

from semgs.files.errors import InputError
from semgs_rooms.assets.catalogue import FileSource, read_catalogue
from semgs_rooms.assets.lock import (
    LockEntry,
    attribution,
    lock_digest,
    lock_of,
    make_lock,
    read_lock,
    verify,
    write_lock,
)

REAL = Path(__file__).parents[3].parent / "shared" / "assets"


@pytest.fixture
def copied(asset_folder, tmp_path) -> Path:
    return Path(shutil.copytree(asset_folder, tmp_path / "copy"))


def test_a_lock_reads_back_as_it_was_made(asset_folder, tmp_path):
    rows = make_lock(asset_folder)
    write_lock(tmp_path / "lock.json", rows)
    assert read_lock(tmp_path / "lock.json") == rows
    assert len(rows) == 2 + 50 + 60


def test_a_folder_satisfies_its_own_lock(asset_folder):
    verify(asset_folder, make_lock(asset_folder))


def test_one_altered_byte_is_named(copied):
    lock = make_lock(copied)
    path = copied / "models" / "cc_sofa_1.glb"
    raw = bytearray(path.read_bytes())
    raw[-5] ^= 1
    path.write_bytes(raw)
    with pytest.raises(InputError, match=r"1 altered: models/cc_sofa_1\.glb"):
        verify(copied, lock)


def test_missing_files_are_counted_and_the_first_ones_named(copied):
    lock = make_lock(copied)
    for number in range(5):
        (copied / f"textures/stone_{number}.png").unlink()
    with pytest.raises(InputError, match=r"5 missing: textures/stone_0\.png, .* and 2 more"):
        verify(copied, lock)


def test_a_folder_that_is_none_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        verify(tmp_path / "nowhere")


def test_an_altered_list_is_noticed_as_well(copied):
    lock = make_lock(copied)
    (copied / "catalog.json").write_text("[]")
    with pytest.raises(InputError, match=r"altered: catalog\.json"):
        verify(copied, lock)


def test_a_folder_with_a_lock_of_its_own_is_held_to_it(copied):
    assert lock_of(copied).name == "lock.json"
    assert lock_of(copied).parent != copied
    write_lock(copied / "lock.json", make_lock(copied))
    verify(copied)
    assert lock_digest(copied) != lock_digest(copied.parent)
    (copied / "textures/stone_0.png").write_bytes(b"")
    with pytest.raises(InputError, match=r"1 altered: textures/stone_0\.png"):
        verify(copied)


def test_a_lock_must_not_lead_out_of_its_folder(tmp_path):
    path = tmp_path / "lock.json"
    write_lock(path, [LockEntry("../secret", FileSource("s", "c", "p", "CC0-1.0"), "0" * 64)])
    with pytest.raises(InputError, match="leads out of the folder"):
        read_lock(path)


def test_attribution_names_what_was_used_with_licence_author_and_source(asset_folder):
    lock = make_lock(asset_folder)
    text = attribution(["models/aa_bed_1.glb", "textures/photo_0.png", "models/aa_bed_1.glb"], lock)
    assert "## CC0-1.0, by Someone" in text
    assert "## CC-BY-4.0, by Someone" in text
    assert text.count("aa_bed_1.glb") == 1
    assert "someone/things@000000000000" in text
    assert "bb_bed_1" not in text
    with pytest.raises(ValueError, match=r"other\.glb"):
        attribution(["models/other.glb"], lock)


def test_every_row_of_the_packages_lock_says_where_from_and_under_which_licence():
    rows = read_lock()
    assert len({row.file for row in rows}) == len(rows) > 2000
    for row in rows[2:]:
        assert row.origin.source
        assert row.origin.commit
        assert row.origin.path
        assert row.origin.licence
        assert len(row.sha256) == 64


@pytest.mark.skipif(not REAL.is_dir(), reason="the folder of assets is not here")
def test_the_collected_assets_satisfy_the_packages_lock():
    verify(REAL)
    catalogue = read_catalogue(REAL)
    assert len(read_lock()) == 2 + len(catalogue.meshes) + len(catalogue.images)
