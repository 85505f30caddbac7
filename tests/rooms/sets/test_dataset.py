import errno
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch

pytest.importorskip("embreex")

from semgs import __version__
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.files.folders import LOCK, lock_folder
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.assets.lock import make_lock, write_lock
from semgs_rooms.sets import dataset
from semgs_rooms.sets.dataset import RoomSettings, claim, write_dataset

ROOMS = RoomSettings(seed=11, size=(36, 48), frames=3)


def tree(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("data") / "rooms"
    write_dataset(path, ROOMS, 4)
    return path


@pytest.mark.long
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.long)])
def test_the_same_recipe_gives_the_same_tree_whatever_the_folder_and_the_workers(workers, whole, tmp_path):
    write_dataset(tmp_path / "elsewhere" / "x", ROOMS, 4, workers=workers)
    assert tree(tmp_path / "elsewhere" / "x") == tree(whole)


def test_a_scene_does_not_depend_on_how_many_there_are(whole, tmp_path):
    write_dataset(tmp_path / "few", ROOMS, 2)
    few, many = tree(tmp_path / "few"), tree(whole)
    assert {name for name in many if name not in few} == {
        name for name in many if name.startswith(("scene_00002", "scene_00003"))
    }
    assert all(many[name] == content for name, content in few.items() if name != "index.json")
    write_dataset(tmp_path / "few", ROOMS, 4)
    assert tree(tmp_path / "few") == many


def test_an_interrupted_run_goes_on_where_it_was_left(whole, tmp_path):
    """Scenes that are there are kept, what was half written is cleared away and drawn again."""
    cut = tmp_path / "cut"
    shutil.copytree(whole, cut)
    (cut / "index.json").unlink()
    half = cut / ".scene_00002.ab12.part"
    (cut / "scene_00002").rename(half)
    (half / "transforms.json").unlink()
    kept = (cut / "scene_00001" / "transforms.json").stat().st_mtime_ns
    told = []
    write_dataset(cut, ROOMS, 4, done=told.append)
    assert told == [3, 4]
    assert (cut / "scene_00001" / "transforms.json").stat().st_mtime_ns == kept
    assert tree(cut) == tree(whole)


def test_the_index_counts_the_pixels_of_every_class(whole):
    index = json.loads((whole / "index.json").read_text())
    assert [scene["folder"] for scene in index["scenes"]] == [f"scene_{k:05d}" for k in range(4)]
    assert sum(index["pixels"].values()) == 4 * 3 * 36 * 48
    counts = torch.zeros(256, dtype=torch.long)
    for scene in index["scenes"]:
        opened = open_scene(whole / scene["folder"])
        labels = opened.read(range(len(opened)), "native").labels
        counts += torch.bincount(labels.flatten().long(), minlength=256)
    assert [index["pixels"][name] for name in SCANNET20.names] == counts[:20].tolist()
    assert index["pixels"]["ignored"] == counts[255]


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"seed": 12}, "seed is 11 there, not 12"),
        ({"frames": 4}, "frames is 3 there, not 4"),
        ({"size": (36, 50)}, r"size is \[36, 48\] there, not \[36, 50\]"),
        ({"style": "other"}, "style is home there, not other"),
    ],
)
def test_scenes_of_other_settings_are_not_mixed(whole, change, told):
    before = tree(whole)
    with pytest.raises(ValueError, match=told):
        write_dataset(whole, RoomSettings(**{"seed": 11, "size": (36, 48), "frames": 3, **change}), 4)
    assert tree(whole) == before


def test_shaded_rooms_of_a_release_that_also_traced_go_on_and_traced_ones_do_not(tmp_path):
    record = {
        "semgs": ROOMS.as_json()["semgs"], "seed": 11, "size": [36, 48], "frames": 3, "style": "home", "render": "shaded", "assets": None,
    }  # fmt: skip
    for render in ("shaded", "traced"):
        (tmp_path / render).mkdir()
        (tmp_path / render / "settings.json").write_text(json.dumps({**record, "render": render}))
    claim(tmp_path / "shaded", ROOMS, 2)
    with pytest.raises(ValueError, match="render is traced there, not shaded"):
        claim(tmp_path / "traced", ROOMS, 2)


def test_scenes_of_the_first_edition_of_homes_are_not_mixed_with_those_of_the_second(tmp_path):
    """The held-out world has not changed, so its data sets go on."""
    first = tmp_path / "first"
    for style in ("home", "other"):
        settings = replace(ROOMS, style=style)
        (first / style).mkdir(parents=True)
        (first / style / "settings.json").write_text(json.dumps({**settings.as_json(), "semgs": __version__}))
    claim(first / "other", replace(ROOMS, style="other"), 2)
    with pytest.raises(ValueError, match="second edition of homes"):
        claim(first / "home", ROOMS, 2)


def test_fewer_scenes_than_are_there_are_refused(whole):
    with pytest.raises(ValueError, match="contains scene_00003"):
        write_dataset(whole, ROOMS, 2)


def test_a_foreign_folder_is_left_alone(tmp_path):
    (tmp_path / "mine.jpg").write_bytes(b"1")
    with pytest.raises(InputError, match="something else"):
        write_dataset(tmp_path, ROOMS, 1)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.jpg"]


def test_a_full_disk_is_told_as_such_and_leaves_no_half_scene(tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, "No space left on device", "x")

    monkeypatch.setattr("semgs_rooms.sets.room_scenes.write_views", full)
    with pytest.raises(OSError, match="No space left") as caught:
        write_dataset(tmp_path / "full", ROOMS, 1)
    assert caught.value.errno == errno.ENOSPC
    assert {path.name for path in (tmp_path / "full").iterdir()} == {dataset.SETTINGS, LOCK}


@pytest.mark.long
def test_scenes_with_assets_name_them_and_are_not_mixed_with_others(asset_folder, tmp_path):
    """The folder of the assets may move; the lock that they satisfy, here one of their own, is part of the settings."""
    rows = make_lock(asset_folder)
    locked = shutil.copytree(asset_folder, tmp_path / "locked")
    write_lock(locked / "lock.json", rows)
    settings = RoomSettings(seed=11, size=(24, 32), frames=2, library=Library(locked))
    moved = shutil.copytree(locked, tmp_path / "moved")
    write_dataset(tmp_path / "one", settings, 3)
    write_dataset(tmp_path / "two", replace(settings, library=Library(moved)), 3)
    assert tree(tmp_path / "one") == tree(tmp_path / "two")
    used = set()
    for room in (tmp_path / "one").glob("scene_*/room.json"):
        used |= set(json.loads(room.read_text())["assets"])
    text = (tmp_path / "one" / "ATTRIBUTION.md").read_text()
    assert used
    assert all(f"`{row.file}`" in text for row in rows if row.file in used)
    assert not any(f"`{row.file}`" in text for row in rows if row.file not in used)
    (tmp_path / "one" / "ATTRIBUTION.md").unlink()
    write_dataset(tmp_path / "one", settings, 3)
    assert (tmp_path / "one" / "ATTRIBUTION.md").read_text() == text
    with pytest.raises(ValueError, match=r"assets is lock [0-9a-f]{16} there, not None"):
        write_dataset(tmp_path / "one", replace(settings, library=None), 3)


def test_a_folder_that_another_process_fills_is_refused_and_nothing_in_it_is_cleared_away(tmp_path):
    claim(tmp_path / "rooms", ROOMS, 1)
    part = tmp_path / "rooms" / ".scene_00000.0123abcd.part"
    part.mkdir()
    with (
        lock_folder(tmp_path / "rooms", "", ""),
        pytest.raises(InputError, match="another process is filling"),
    ):
        write_dataset(tmp_path / "rooms", ROOMS, 1)
    assert part.exists()
    claim(tmp_path / "rooms", ROOMS, 1)
    assert not part.exists()


def test_a_complete_folder_is_only_read_so_several_processes_may_ask_for_it(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "rooms")
    counts = []
    with lock_folder(folder, "", ""):
        index = write_dataset(folder, ROOMS, 4, done=counts.append)
        assert counts == [4]
        assert index == json.loads((folder / "index.json").read_text())
        for missing in ("scene_00000/room.json", "index.json"):
            (folder / missing).unlink()
            with pytest.raises(InputError, match="another process is filling"):
                write_dataset(folder, ROOMS, 4)


def test_scenes_that_its_index_does_not_list_yet_are_too_many_as_well(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "rooms")
    shutil.copytree(
        folder / "scene_00003", folder / "scene_00004"
    )  # as where more were requested, and that was interrupted
    with pytest.raises(ValueError, match="contains scene_00004, which is more than the 4 requested scenes"):
        write_dataset(folder, ROOMS, 4)


def test_an_index_of_other_scenes_is_written_anew(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "rooms")
    index = (folder / "index.json").read_text()
    for other in ("[]", index.replace("scene_00001", "scene_00007")):
        (folder / "index.json").write_text(other)
        write_dataset(folder, ROOMS, 4)
        assert (folder / "index.json").read_text() == index


@pytest.mark.long
def test_what_goes_wrong_in_a_worker_is_told_as_if_it_went_wrong_here(tmp_path):
    out = tmp_path / "rooms"
    write_dataset(out, ROOMS, 1)
    shutil.rmtree(out / "scene_00000")
    (out / "scene_00000").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="found a broken link"):
        write_dataset(out, ROOMS, 1, workers=1)


@pytest.mark.parametrize(
    "change", [{"seed": -1}, {"size": (0, 4)}, {"frames": 1}, {"style": "castle"}, {"render": "x"}]
)
def test_recipes_that_cannot_be_are_refused(change):
    with pytest.raises(Exception, match=r"expected|violates|type"):
        RoomSettings(**{"seed": 1, "size": (4, 6), **change})
