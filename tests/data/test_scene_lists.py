"""Lists of scenes: those inside the package are what their names say, rules are kept, and rooms that were seen are found."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from semgs.data.scene_lists import (
    check_unseen,
    held_out,
    package_lists,
    read_list,
    room_of,
    seen_before,
)
from semgs.data.scenes import open_scenes
from semgs.files.errors import InputError

SIZES = {
    "scannet-train": 1201, "scannet-val": 312, "scannet-test": 100, "scannet-sray-train": 198, "scannet-sray-val": 3,
    "scannet-sray-test": 10, "scannet-gsnerf-train": 61, "scannet-gsnerf-test": 10, "replica-gsnerf-train": 12,
    "replica-gsnerf-test": 4, "scannet-1000-without-sray": 1000, "scannet-1000-without-gsnerf": 1000, "scannet-lsm": 49,
}  # fmt: skip
"""As the peers' and ScanNet's own files have them."""


def test_the_lists_inside_the_package_are_whole():
    assert {name: len(read_list(name).names) for name in package_lists()} == SIZES
    for name in package_lists():
        assert max(Counter(read_list(name).names).values()) == 1
        assert all(room_of(scene) for scene in read_list(name).names), "every name tells its room"


def test_the_lists_inside_the_package_are_those_of_the_reference(shared: Path):
    splits = shared / "reference" / "splits"
    for file, name in (
        *((f"official_scannetv2_{part}", f"scannet-{part}") for part in ("train", "val", "test")),
        *((f"sray_scannet_{part}", f"scannet-sray-{part}") for part in ("train", "val", "test")),
        *((f"gsnerf_{data}_{part}", f"{data}-gsnerf-{part}") for data in ("scannet", "replica") for part in ("train", "test")),
    ):  # fmt: skip
        assert read_list(splits / f"{file}.txt").names == read_list(name).names


@pytest.mark.parametrize("peer", ["sray", "gsnerf"])
def test_the_training_list_is_the_first_thousand_official_scans_that_share_no_room_with_the_test(peer: str):
    official, tested = read_list("scannet-train").names, read_list(f"scannet-{peer}-test").names
    trained = read_list(f"scannet-1000-without-{peer}").names
    rooms = {name[:9] for name in tested}
    assert trained == tuple(name for name in official if name[:9] not in rooms)[:1000]
    assert not any(name[:9] in rooms for name in trained)
    skipped = [name for name in official[: official.index(trained[-1])] if name not in trained]
    assert skipped
    assert all(name[:9] in rooms for name in skipped), "a scan is passed over for its room alone"


def test_the_peers_own_split_keeps_rooms_apart_and_gsnerfs_test_is_in_srays_training():
    tested = read_list("scannet-sray-test").names
    assert seen_before(read_list("scannet-sray-train").names, tested) == {}
    seen = seen_before(read_list("scannet-sray-train").names, read_list("scannet-gsnerf-test").names)
    assert sorted(seen) == [f"scene{room}_00" for room in ("0063", "0067", "0071", "0074", "0079", "0086")]


def test_another_scan_of_a_room_is_a_leak_that_names_both():
    with pytest.raises(InputError, match=r"scene0211_00 \(as scene0211_03\), scene0300_01; go elsewhere") as caught:
        check_unseen(
            "weights",
            ["scene0211_03", "scene0300_01"],
            ["scene0300_01", "scene0211_00", "scene0001_00"],
            "go elsewhere",
        )
    assert "found 2 that were" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "room"),
    [
        ("scene0211_03", "scene0211"),
        ("0a76e06478", "0a76e06478"),
        ("office_0/Sequence_1", "office_0"),
        ("office_0_Sequence_2", "office_0"),
        ("chess_seq-01", "chess"),
        ("scan1", None),
        ("scene1", None),
        ("room", None),
    ],
)
def test_a_room_is_known_by_names_that_mean_the_same_everywhere(name: str, room: str | None):
    assert room_of(name) == room


def test_names_that_say_nothing_outside_their_folder_are_no_leak():
    check_unseen("weights", ["scan1", "room"], ["scan1", "room"], "")


def test_ten_and_all_but_ten_part_a_file_whatever_its_order(tmp_path: Path):
    names = [f"{number:010x}" for number in range(0xABCDE, 0xABCDE + 30)]
    (tmp_path / "all.txt").write_text("\n".join(names))
    (tmp_path / "turned.txt").write_text("\r\n".join(reversed(names)))
    ten, rest = (read_list(f"{rule}:{tmp_path / 'all.txt'}").names for rule in ("ten", "all-but-ten"))
    assert (len(ten), len(rest)) == (10, 20)
    assert set(ten) | set(rest) == set(names)
    assert list(rest) == [name for name in names if name in rest], "in the file's order"
    assert set(read_list(f"ten:{tmp_path / 'turned.txt'}").names) == set(ten) == held_out(names)
    assert len(held_out([*names, "another"]) - set(ten)) <= 1, "one scene more changes one of the ten at most"


def test_the_held_out_ones_are_those_of_smallest_hash():
    # printf 'b' | sha256sum: 3e23..., 'c': 2e7d..., 'a': ca97...
    assert held_out(["a", "b", "c"], 2) == {"b", "c"}


def test_lists_that_cannot_be_read_are_refused(tmp_path: Path):
    (tmp_path / "empty.txt").write_text("\n# nobody\n \n")
    with pytest.raises(InputError, match=r"empty\.txt: expected names of scenes, one per line, found an empty list"):
        read_list(tmp_path / "empty.txt")
    with pytest.raises(
        InputError, match=r"scannet-sray: expected a text file of scenes, or one of .*scannet-sray-test"
    ):
        read_list("scannet-sray")
    (tmp_path / "few.txt").write_text("a\nb\n")
    with pytest.raises(InputError, match="more than 10 scenes, to hold out 10 of them, found 2"):
        read_list(f"ten:{tmp_path / 'few.txt'}")


def test_scenes_of_a_list_are_opened_and_others_are_not(tmp_path: Path):
    from semgs.data.demo_scene import demo_scene

    for name in ("a", "b"):
        (tmp_path / "data").mkdir(exist_ok=True)
        (tmp_path / "data" / name).symlink_to(demo_scene())
    (tmp_path / "data" / "broken").mkdir()
    (tmp_path / "data" / "broken" / "transforms.json").write_text("{")
    (tmp_path / "list.txt").write_text("# one\nb\n")
    wanted = read_list(tmp_path / "list.txt")
    assert [scene.name for scene in open_scenes(tmp_path / "data", wanted=wanted)] == ["b"]
    (tmp_path / "list.txt").write_text("b\nc\n")
    with pytest.raises(
        InputError, match=r"1 of 2 names: expected names of scenes in .*, such as a, found c, which is missing"
    ):
        open_scenes(tmp_path / "data", wanted=read_list(tmp_path / "list.txt"))
