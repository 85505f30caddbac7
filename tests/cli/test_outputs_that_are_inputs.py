"""What a command reads stays, even if it is named as the output, too, with --overwrite."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import pytest

from semgs.cli.main import COMMANDS, main
from semgs.files.folders import MARK, own_folder

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
        with own_folder(tmp_path / name) as folder:
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


def test_every_command_that_replaces_its_output_has_a_case() -> None:
    """But demo, whose input is in the package, and view, whose page ends with .html."""
    replacing = {
        name for name, command in COMMANDS.items() if "overwrite" in {field.name for field in fields(command.load())}
    }
    assert replacing == {case.split()[0] for case in CASES} | {"demo", "view"}
