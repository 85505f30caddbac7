"""The commands that are killed, on small scenes, and what must be true of their folders at any moment."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

from semgs.files.folders import LOCK

Tree = dict[str, bytes]
"""The files of a folder by their relative paths."""


@dataclass(frozen=True)
class Case:
    """A command and its output folder.

    Attributes:
        name: of the command.
        kills: how many times `make faults` kills it.
        before: the command that made what already is in the folder, from the inputs and the folder.
        command: the one to kill.
        units: patterns of folders in the output that are complete or absent; "." is the output itself.
        varying: patterns of files that differ from run to run, such as times; the names of all others decide their bytes.
        open_ended: patterns of files that grow, and may end anywhere.
    """

    name: str
    kills: int
    before: Callable[[Path, Path], list[str]]
    command: Callable[[Path, Path], list[str]]
    units: tuple[str, ...] = ()
    varying: tuple[str, ...] = ()
    open_ended: tuple[str, ...] = ()

    def varies(self, name: str) -> bool:
        """Whether a file's bytes may differ from run to run."""
        return _matches(name, self.varying)

    def fits_anywhere(self, name: str) -> bool:
        """Whether a file may end anywhere."""
        return _matches(name, self.open_ended)


def lay_inputs(folder: Path) -> None:
    """Write the scenes that all commands read; `folder/saved` is a reconstruction."""
    from saved_scenes import wall
    from scenes_on_disk import write_labelled

    from semgs.scene.scene_file import save_scene

    for number, name in enumerate(("one", "two")):
        write_labelled(folder / "scans" / name, number + 1)
    (folder / "saved").mkdir()
    save_scene(folder / "saved/scene.safetensors", wall())


def _reconstruct(context: str) -> Callable[[Path, Path], list[str]]:
    return lambda inputs, out: [
        "reconstruct", str(inputs / "scans/one"), "--out", str(out), "--weights", "random", "--size", "32x48", "--context", *context,
        "--overwrite",
    ]  # fmt: skip


def _export(*formats: str) -> Callable[[Path, Path], list[str]]:
    return lambda inputs, out: ["export", str(inputs / "saved"), "--out", str(out), "--overwrite", "--as", *formats]


def _rooms(scenes: int) -> Callable[[Path, Path], list[str]]:
    options = ["--size", "32x48", "--frames", "2", "--workers", "0", "--seed", "3"]
    return lambda inputs, out: ["rooms", str(out), "--scenes", str(scenes), *options]


def _prepare(*scenes: str) -> Callable[[Path, Path], list[str]]:
    def arguments(inputs: Path, out: Path) -> list[str]:
        source = inputs / "scans" / scenes[0] if len(scenes) == 1 else inputs / "scans"
        return ["prepare", str(source), str(out), "--size", "32x48", "--workers", "0"]

    return arguments


def _train(steps: int) -> Callable[[Path, Path], list[str]]:
    options = "--batch 1 --size 16x24 --contexts 2 2 --targets 1 --validate-every 2 --validation-scenes 1 --workers 0 --save-minutes 0"
    return lambda inputs, out: [
        "train", "small", "--out", str(out), "--steps", str(steps), "--data", str(inputs / "scans/one"), *options.split(),
    ]  # fmt: skip


CASES = {
    case.name: case
    for case in (
        Case(
            "train", 100, _train(1), _train(3),
            varying=("checkpoints/*", "tensorboard/*", "validation/*", "settings.json", "*.json", ".lock", "*.jsonl", "*.safetensors"),
            open_ended=("tensorboard/*", "*.jsonl", ".lock"),
        ),
        Case("reconstruct", 40, _reconstruct("03"), _reconstruct("14"), units=(".",), varying=("report.*", "scene.safetensors")),
        Case("rooms", 40, _rooms(1), _rooms(2), units=("scene_*",)),
        Case("prepare", 40, _prepare("one"), _prepare("one", "two")),
        Case("export", 40, _export("ply"), _export("ply", "points", "gltf", "colmap"), units=(".",)),
    )
}  # fmt: skip


def tree(folder: Path) -> Tree:
    """All files of a folder but those with a temporary name, or in a folder with one."""
    if not folder.exists():
        return {}
    paths = {path: path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file()}
    return {str(name): path.read_bytes() for path, name in paths.items() if not _temporary(name)}


def _temporary(name: Path) -> bool:
    return any(
        part.startswith(".") and part.endswith((".part", ".old", ".lock")) and part != LOCK for part in name.parts
    )


def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatch(name, pattern) for pattern in patterns)


def wrong(case: Case, before: Tree, found: Tree, after: Tree) -> list[str]:
    """What is wrong with a folder, given that it was `before` and should become `after`: what is lost, and what is incomplete."""
    said = [f"{name} is lost" for name in before.keys() - found.keys() if case.units != (".",) and name in after]
    said += [f"{name} is unknown" for name in found.keys() - before.keys() - after.keys() if not case.varies(name)]
    for name, data in found.items():
        if not case.varies(name):
            if data not in (before.get(name), after.get(name)):
                said.append(f"{name} is neither the old nor the new file ({len(data)} bytes)")
        elif not case.fits_anywhere(name) and (fault := incomplete(name, data)):
            said.append(f"{name}: {fault}")
    for unit in case.units:
        for folder in sorted({_unit(name, unit) for name in found} - {None}):
            inside = {name for name in found if _unit(name, unit) == folder}
            if inside not in [{name for name in one if _unit(name, unit) == folder} for one in (before, after)]:
                said.append(f"{folder} is incomplete: {sorted(inside)}")
    return said


def _unit(name: str, pattern: str) -> str | None:
    """The unit that a file belongs to."""
    if pattern == ".":
        return "."
    first = name.split("/")[0]
    return first if fnmatch(first, pattern) else None


def incomplete(name: str, data: bytes) -> str | None:
    """What is wrong with a file whose bytes are not known."""
    try:
        if name.endswith(".json"):
            json.loads(data)
        elif name.endswith(".safetensors"):
            import safetensors.torch

            safetensors.torch.load(data)
        elif name.endswith(".html") and not data.rstrip().endswith(b"</html>"):
            return "the page ends early"
        elif not data:
            return "it is empty"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return None
