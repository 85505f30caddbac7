"""`semgs batch`: one command for many scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from glob import glob
from pathlib import Path
from typing import Annotated, Literal

import tyro

from semgs.cli.arguments import parse
from semgs.cli.options.types import Count
from semgs.cli.progress import show_progress
from semgs.cli.usage_errors import UsageError
from semgs.files.errors import InputError
from semgs.files.paths import found_at, typed_path

FORMS = {
    "reconstruct": ("{scene}", "--out", "{out}"),
    "poses": ("{scene}", "{out}"),
    "doctor": ("{scene}", "--page", "{out}.html"),
    "export": ("{scene}", "--out", "{out}"),
    "label": ("{scene}", "{out}"),
    "label-splat": ("{scene}", "--out", "{out}"),
}
"""How each command names its input and its output."""

EACH = 2_000_000_000
"""Memory that a worker may take [bytes]."""

SOME_FAILED = 3
"""The exit code if some scenes failed."""


def _matching(word: str) -> list[Path]:
    """The paths that a word with wildcards matches, or the path that it is. A shell has already done so, unless the word was quoted."""
    return sorted(map(Path, glob(word))) or [typed_path(word)]  # noqa: PTH207 - patterns may begin at the root


@dataclass(frozen=True)
class Batch:
    """Run a command for many scenes, several at a time.

    Each scene gets a folder in OUT, complete or absent. To resume, repeat the command: scenes that are done with the same options and the same files
    are skipped. A scene that fails gets a line in OUT/failures.jsonl, and the others go on. The exit code is 3 if some failed.

    All other options are those of the command. {name} in them becomes the name of the scene.

    Examples
    - semgs batch reconstruct scans --out out/scans --views 3
    - semgs batch reconstruct recordings/* --out out/walks --all
    - semgs batch export out/scans --out out/points --as points
    - semgs batch label-splat splats/*.ply --out out/labelled --cameras scans/{name}
    """

    command: Annotated[
        Literal["reconstruct", "poses", "doctor", "export", "label", "label-splat"],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="COMMAND"),
    ]
    """What to run: reconstruct, poses, doctor, export, label or label-splat."""
    data: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="DATA [DATA ...]")]
    """Scenes, or folders of scenes; for poses, folders of photos and clips; for export, reconstructions; for label-splat, splats."""
    out: Annotated[Path, tyro.conf.arg(metavar="OUT")]
    """Folder for the results: new, empty, or that of an earlier call."""
    scenes: Annotated[str, tyro.conf.arg(metavar="LIST", help_behavior_hint="")] = ""
    """Only the scenes of a list, as for semgs evaluate."""
    workers: Annotated[Count | None, tyro.conf.arg(metavar="N", help_behavior_hint="")] = None
    """Scenes at a time, each with one thread. By default as many as there are cores, and memory for each."""
    retry_failed: bool = False
    """Also try scenes again that failed."""
    shard: Annotated[str, tyro.conf.arg(metavar="I/N", help_behavior_hint="")] = ""
    """Only the I-th of N equal parts, counted from 1: for job arrays of a cluster, which share OUT."""

    @classmethod
    def split(cls, arguments: Sequence[str]) -> tuple[list[str], list[str]]:
        """The arguments of this command, and those of the command that it runs."""
        own = {f"--{field.name.replace('_', '-')}": field.type == "bool" for field in fields(cls)}
        mine, others = [], []
        words = list(arguments)
        while words and not words[0].startswith("-"):
            mine.append(words.pop(0))
        while words:
            word = words.pop(0)
            name, _, value = word.partition("=")
            kept = mine if name in own or word in ("-h", "--help") else others
            kept.append(word)
            if kept is mine and not own.get(name, True) and not value and words:
                kept.append(words.pop(0))
        return mine, others

    def run_with(self, options: Sequence[str]) -> int:
        """Run the command for each scene, and return the exit code.

        Args:
            options: of the command.

        Raises:
            InputError: there is no scene, or OUT cannot be used.
            UsageError: an option of the command is invalid.
        """
        paths = self._places()
        names = self._names(paths)
        self._check_options(paths[0], names[0], options)
        from semgs.batch.tasks import make_task
        from semgs.files.folders import lock_folder

        self.out.mkdir(parents=True, exist_ok=True)
        tasks = []
        for path, name in zip(paths, names, strict=True):
            given = [word.replace("{name}", name) for word in options]
            tasks.append(
                make_task(name, [self.command, *self._form(path, name), *given], [self.command, *given], [path])
            )
        if self.shard:
            return self._work(tasks)
        with lock_folder(self.out / "lock", "a folder that no other batch fills", "one that another process fills"):
            return self._work(tasks)

    def _work(self, tasks: Sequence) -> int:
        """Run what is left to do, record it, and return the exit code."""
        from semgs.batch.local_workers import run_locally
        from semgs.batch.records import left_to_do, write_failures, write_record
        from semgs.cli.batch_work import begin, work

        left = left_to_do(self.out, tasks, self.retry_failed)
        print(f"{len(tasks) - len(left)} of {len(tasks)} scenes are done")
        failed = 0
        with show_progress(f"semgs {self.command}", len(left)) as done:
            for count, record in enumerate(run_locally(work, left, self._crew(), begin) if left else ()):
                write_record(self.out, record)
                failed += not record.succeeded
                if not record.succeeded:
                    print(f"{record.name}: {record.why}", flush=True)
                done(count + 1)
        failures = write_failures(self.out, tasks)
        print(
            f"{len(tasks) - failures} of {len(tasks)} scenes succeeded"
            + (f"; see {self.out / 'failures.jsonl'}" if failures else "")
        )
        return SOME_FAILED if failures else 0

    def _places(self) -> list[Path]:
        """The scenes, or this shard of them."""
        from semgs.data.scene_lists import read_list
        from semgs.data.scenes import scene_paths

        found: list[Path] = []
        for word in self.data:
            for path in _matching(word):
                if self.command in ("reconstruct", "doctor", "label"):
                    found += scene_paths(path, read_list(self.scenes) if self.scenes else None)
                elif self.command == "export" and path.is_dir() and not (path / "scene.safetensors").is_file():
                    found += sorted(one.parent for one in path.glob("*/scene.safetensors"))
                elif path.exists():
                    found.append(path)
                else:
                    raise InputError(path, f"input of semgs {self.command}", found_at(path))
        if not found:
            raise InputError(self.data[0], f"input of semgs {self.command}", "none")
        if not self.shard:
            return found
        part, _, parts = self.shard.partition("/")
        if not (part.isdigit() and parts.isdigit() and 1 <= int(part) <= int(parts)):
            raise UsageError(f"--shard is {self.shard}; expected I/N, such as 1/8")
        return found[int(part) - 1 :: int(parts)]

    def _names(self, paths: Sequence[Path]) -> list[str]:
        """A name for each scene."""
        from semgs.batch.tasks import scene_names

        try:
            return scene_names(paths)
        except ValueError as error:
            raise UsageError(str(error)) from None

    def _form(self, path: Path, name: str) -> list[str]:
        """The arguments for input and output of a scene."""
        return [word.format(scene=path, out=self.out / name) for word in FORMS[self.command]]

    def _check_options(self, path: Path, name: str, options: Sequence[str]) -> None:
        """Check that the command can be parsed with its options."""
        from semgs.cli.main import COMMANDS

        given = [word.replace("{name}", name) for word in options]
        parse(COMMANDS[self.command].load(), f"semgs {self.command}", [*self._form(path, name), *given])

    def _crew(self) -> int:
        """How many scenes at a time."""
        from os import cpu_count

        from semgs.runtime.free_memory import free_bytes

        if self.workers is not None:
            return self.workers
        return max(1, min(cpu_count() or 1, int(free_bytes() // EACH)))
