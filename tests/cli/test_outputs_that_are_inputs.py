"""What a command reads stays, even if it is named as the output, too, with --overwrite."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import pytest
from blocks import room_of_blocks
from paper_commands import COMMANDS as WORKSHOP
from paper_commands import main

from semgs.cli.main import COMMANDS
from semgs.export.ply import save_ply
from semgs.files.folders import MARK, own_folder
from semgs_rooms.sets.dataset import RoomSettings, write_dataset

CASES = (
    "reconstruct {own} --out {own}",
    "reconstruct {own}/transforms.json --out {own}",
    "reconstruct {own}/images/.. --out {link}",
    "reconstruct {other} --out {own} --weights {own}/a.safetensors",
    "reconstruct {other} --out {own} --depth {own}/images",
    "reconstruct {other} --out {own} --segmenter {own}",
    "reconstruct {other} --out {own} --segmenter hf:a/b --correspondence {own}/a.json",
    "reconstruct {other} --out {own} --features {own}/images",
    "reconstruct {other} --out {own} --images {own}/images",
    "export {own} --out {own}",
    "export {own}/a.ply --out {own} --as points",
    "export {other}/a.ply --cameras {own} --out {own}",
    "render {own} --out {own}",
    "render {other} --path {own}/transforms.json --out {own}",
    "render {other}/a.ply --cameras {own} --out {own}",
    "query {own} --embedding {other}/a.npy --out {own}",
    "query {other} --embedding {own}/a.npy --out {own}",
    "poses {own}/images {own}",
    "poses {other} {own} --predictions {own}/a.npz",
    "label-splat {own}/a.ply --cameras {other} --out {own}",
    "label-splat {other}/a.ply --cameras {own} --out {own}",
    "label-splat {other}/a.ply --cameras {other} --out {own} --weights {own}/a.safetensors",
    "label-splat {other}/a.ply --cameras {other} --out {own} --segmenter {own}/images",
    "evaluate small --data {own} --out {own}",
    "evaluate {own}/a.safetensors --data {other} --out {own}",
    "evaluate small --data {other} --scenes {own}/a.txt --out {own}",
    "evaluate small --data {other} --protocol pinned {own}/a.json --out {own}",
    "evaluate small --data {other} --depth {own}/images --out {own}",
    "evaluate small --data {other} --segmenter {own}/images --out {own}",
    "evaluate --predictions {own}/images --data {other} --out {own}",
    "figure qualitative --weights small --data {own} --out {own}",
    "figure qualitative --weights {own}/a.safetensors --data {other} --out {own}",
    "figure qualitative --weights small --data {other} --predictions a={own}/images --out {own}",
    "figure qualitative --weights small --data {other} --protocol pinned {own}/a.json --out {own}",
    "export-network {own}/a.safetensors --out {own}/a.safetensors",
    "doctor {own}/transforms.json --fix {own}/transforms.json",
)


@pytest.mark.parametrize("command", CASES)
def test_it_is_refused_in_one_line_and_nothing_is_lost(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("own", "other"):
        with own_folder(tmp_path / name, "reconstruct") as folder:
            (folder / "images").mkdir()
            for file in ("a.ply", "a.npy", "a.npz", "a.json", "a.txt", "a.safetensors", "transforms.json"):
                (folder / file).write_text(name)
    (tmp_path / "link").symlink_to(tmp_path / "own")
    before = sorted(tmp_path.rglob("*"))
    paths = {name: tmp_path / name for name in ("own", "other", "link")}
    assert main([*command.format(**paths).split(), "--overwrite"]) == 2
    told = capsys.readouterr().err
    assert "expected an output apart from the input, found " in told
    assert told.count("\n") == 1
    assert sorted(tmp_path.rglob("*")) == before
    assert (tmp_path / "own" / MARK).exists()


REFERRED = (
    "reconstruct {list} --weights random --out {rooms}/scene_00000",
    "evaluate small --data {rooms} --out {rooms}/scene_00000",
    "evaluate small --single --data {rooms} --out {rooms}/scene_00000",
    "figure qualitative --weights small --data {rooms} --out {rooms}/scene_00000",
    "label-splat {splat} --cameras {list} --out {rooms}/scene_00000",
)
"""Commands that read a scene which is in a folder of scenes, or whose images are named elsewhere."""


@pytest.fixture(scope="module")
def rooms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("referred") / "rooms"
    write_dataset(folder, RoomSettings(78, (32, 48), 3), 1)
    (folder / "scene_00000" / MARK).write_text("")  # does not say which command may replace the folder
    return folder


@pytest.mark.parametrize("command", REFERRED)
def test_so_is_a_scene_of_a_data_set_and_one_that_has_the_images(
    command: str, rooms: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = rooms / "scene_00000"
    listed = json.loads((scene / "transforms.json").read_text())
    for frame in listed["frames"]:
        frame["file_path"] = str(scene / frame["file_path"])
        del frame["depth_file_path"], frame["label_file_path"]
    (tmp_path / "transforms.json").write_text(json.dumps(listed))
    save_ply(tmp_path / "a.ply", room_of_blocks().gaussians)
    before = sorted(rooms.rglob("*"))
    paths = {"rooms": rooms, "list": tmp_path / "transforms.json", "splat": tmp_path / "a.ply"}
    assert main([*command.format(**paths).split(), "--overwrite"]) == 2
    assert "expected an output apart from the input, found " in capsys.readouterr().err
    assert sorted(rooms.rglob("*")) == before


def test_every_command_that_replaces_its_output_has_a_case() -> None:
    """But demo, whose input is in the package, and view, whose page ends with .html."""
    options = {name: command.load() for name, command in COMMANDS.items()} | WORKSHOP
    replacing = {name for name, own in options.items() if "overwrite" in {field.name for field in fields(own)}}
    assert replacing == {case.split()[0] for case in CASES} | {"demo", "view"}
