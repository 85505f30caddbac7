"""`semgs batch`: one command for many scenes."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, fields
from functools import partial
from glob import glob
from pathlib import Path
from time import localtime, strftime, time
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from semgs.cli.arguments import parse
from semgs.cli.progress import show_progress
from semgs.files.errors import InputError, readable
from semgs.files.paths import found_at, typed_path
from semgs.files.text import counted, shortened
from semgs.run.options.types import CountOrAuto
from semgs.run.options.words import Words, one_word, optional, positional
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs.runtime.cores import usable_cores

if TYPE_CHECKING:
    from semgs.batch.records import Record
    from semgs.batch.tasks import Task
    from semgs.run.outcome import Run

Command = Literal["reconstruct", "poses", "doctor", "export", "label", "label-splat"]

ANY = "{name}"
"""What stands for the name of a scene, or for its input and output until they are known."""

ENDINGS = {"doctor": ".html"}
"""Endings of results that are files."""

SETTINGS = "batch.json"
"""The file in OUT that says which command fills it."""

SCENE = "scene.safetensors"
"""The file that makes a folder a reconstruction."""

RESERVED = ("records", "pictures", "batch.json", "index.html", "index.csv", "failures.jsonl")
"""Files and folders in OUT that are no results."""

LONGEST_NAME = 235
"""Bytes of a scene's name: file systems allow 255, and `.NAME.json.1a2b3c4d.part` is 20 longer."""

SOME_FAILED = 3
"""The exit code if some scenes failed."""

MINUTE = 60.0
"""Time between lines on the progress, if stderr is no terminal [s]."""


def _matching(word: str) -> list[Path]:
    """The path that a word is, or the paths that it matches if there is none: a shell has already replaced wildcards, unless the word was quoted, and
    names may have brackets."""
    path = typed_path(word)
    return [path] if path.exists() else sorted(map(Path, glob(word))) or [path]  # noqa: PTH207 - patterns may begin at the root


def _bytes_of(name: str) -> int:
    """How long a name is for a file system [bytes]."""
    return len(os.fsencode(name))


def _part_and_parts(text: str) -> tuple[int, int]:
    """(I, N) of "I/N"."""
    part, _, parts = text.partition("/")
    if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
        raise ValueError(f"expected I/N, such as 1/8, found {text!r}")
    return int(part), int(parts)


Shard = Annotated[tuple[int, int] | None, one_word("I/N", _part_and_parts)]


@dataclass(frozen=True)
class Batch:
    """Run a command for many scenes, several at a time.

    Each scene gets a folder in OUT, complete or absent. OUT/index.html shows them all, OUT/index.csv is the same for pandas. To resume, repeat the
    command: scenes that are done with the same options and the same files are skipped. A scene that fails gets a line in OUT/failures.jsonl, and the
    others continue. The exit code is 3 if some failed.

    All other options are those of the command; semgs COMMAND --help lists them. {name} in them becomes the name of the scene. See docs/batch.md.

    Examples
    - semgs batch reconstruct scans --out out/scans --views 3
    - semgs batch reconstruct recordings/* --out out/walks --all
    - semgs batch export out/scans --out out/points --as points
    - semgs batch label-splat splats/*.ply --out out/labelled --cameras scans/{name}
    - semgs batch label scannetpp/data --out data/labelled --segmenter segformer.onnx --ray auto
    """

    excludes: ClassVar = {"--ray": ("--workers", "--shard")}

    command: Annotated[Command, positional("COMMAND")]
    """What to run: reconstruct, poses, doctor, export, label or label-splat."""
    data: Annotated[tuple[str, ...], positional("DATA [DATA ...]")]
    """Scenes, or folders of scenes; for poses, folders of photos and clips; for export, reconstructions; for label-splat, splats."""
    out: Annotated[Path, Words(metavar="OUT")]
    """Folder for the results: new, empty, or that of an earlier call."""
    scenes: Annotated[str, optional("LIST")] = ""
    """Only the scenes of a list: an included one (scannet-val), or a text file with one name per line; see docs/reproduce.md."""
    workers: Annotated[CountOrAuto, optional()] = None
    """Scenes at a time, each with one thread. By default one per core, or fewer if memory is short."""
    retry_failed: bool = False
    """Also try scenes again that failed."""
    shard: Annotated[Shard, optional()] = None
    """Only part I of N, counted from 1: for job arrays of a cluster. All parts write to the same OUT."""
    ray: Annotated[str, optional("auto|ADDRESS")] = ""
    """Run on a Ray cluster instead of this machine alone: the one that it belongs to (auto), or the one at HOST:PORT. Needs the extra cluster."""

    @classmethod
    def split(cls, arguments: Sequence[str]) -> tuple[list[str], list[str]]:
        """The arguments of this command, and those of the command that it runs.

        Raises:
            UsageError: an option of this command is given twice.
        """
        own = {f"--{field.name.replace('_', '-')}": field.type == "bool" for field in fields(cls)[2:]}
        mine: list[str] = []
        others: list[str] = []
        words = list(arguments)
        while words and not words[0].startswith("-"):
            mine.append(words.pop(0))
        while words:
            word = words.pop(0)
            name, _, value = word.partition("=")
            if name in own and any(before.partition("=")[0] == name for before in mine):
                raise UsageError(f"{name} is given twice")
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
            UsageError: an option is invalid.
            ImportError: Ray is not installed.
        """
        self._check()
        paths = self._paths()
        names = self._names(paths)
        given = self._parse(options)
        from semgs.batch.records import FOLDER, remove_leftovers
        from semgs.files.folders import LOCK, lock_folder

        self._claim(paths, names)
        tasks = [self._task(path, name, given) for path, name in zip(paths, names, strict=True)]
        part, parts = self.shard or (1, 1)
        ours = tasks[part - 1 :: parts]
        lock = f".lock_{part}_of_{parts}" if self.shard else LOCK
        with lock_folder(
            self.out / FOLDER, "a folder that no other batch is filling", "one that another process is filling", lock
        ):
            clear = partial(remove_leftovers, self.out, [task.name for task in ours], shared=self.shard is not None)
            clear()  # of an earlier call
            try:
                return self._work(ours, given)
            finally:
                clear()  # of workers that were killed
                self._write_overview(tasks)

    def _check(self) -> None:
        """Check what can be checked without looking for scenes."""
        if self.ray:
            from semgs.batch.cluster import check_ray

            check_ray()

    def _work(self, tasks: Sequence[Task], given: Run) -> int:
        """Run what is left to do, and return the exit code."""
        from semgs.batch.records import Record, is_done, read_record, write_record

        left = [task for task in tasks if not is_done(task, self.retry_failed)]
        waiting = {task.name for task in left}
        skipped = [
            record for task in tasks if task.name not in waiting and (record := read_record(self.out, task.name))
        ]
        failed_before = [record for record in skipped if not record.succeeded]
        print(f"{len(skipped) - len(failed_before):,} of {len(tasks):,} scenes are done", flush=True)
        before = [(task, read_record(self.out, task.name)) for task in left]
        if redone := sum(bool(one and one.succeeded and one.fingerprint != task.fingerprint) for task, one in before):
            were = counted(redone, "scene was", "scenes were")
            print(f"{were} done with other options or other files; the results are replaced", flush=True)
        for record in failed_before:
            print(f"{record.name}: {record.why}")
        if failed_before:
            were = counted(len(failed_before), "scene was", "scenes were")
            print(f"{were} skipped after failing in an earlier call; --retry-failed tries again", flush=True)
        with show_progress(f"semgs {self.command}", len(left)) as show, closing(self._records(left, given)) as found:
            pace = Pace(len(left), show)
            for position, outcome in found:
                if isinstance(outcome, Exception):
                    task, code = left[position], getattr(outcome, "code", 0) or -1
                    outcome = Record(task.name, task.fingerprint, code, str(outcome))
                    write_record(self.out, outcome)
                pace.add(outcome)
        records = [read_record(self.out, task.name) for task in tasks]
        failed = sum(record is not None and not record.succeeded for record in records)
        more = f"; see {self.out / 'failures.jsonl'}" if failed else ""
        print(f"{len(tasks) - failed:,} of {len(tasks):,} scenes succeeded{more}")
        print(f"Open {self.out / 'index.html'} in a browser.")
        return SOME_FAILED if failed else 0

    def _records(self, tasks: Sequence[Task], given: Run) -> Generator[tuple[int, Record | Exception], None, None]:
        """Run tasks on this machine or on a cluster: their positions, with their records or why there is none."""
        if not tasks:
            return
        from semgs.batch.cluster import run_on_cluster
        from semgs.batch.tasks import demands_of
        from semgs.batch.work import begin, settle, work
        from semgs.runtime.free_memory import free_bytes
        from semgs.runtime.workers import finished

        here = str(Path.cwd())
        if self.ray:
            demands = demands_of(self.command, given)
            try:
                with what_the_user_gave():
                    yield from run_on_cluster(work, tasks, self.ray, demands, partial(settle, here))
            except ConnectionError:
                raise UsageError(f"--ray is {self.ray}; expected the address of a running Ray cluster") from None
        else:
            workers = self.workers or demands_of(self.command, given).workers(usable_cores(), free_bytes())
            yield from finished(work, tasks, workers, partial(begin, here))

    def _write_overview(self, tasks: Sequence[Task]) -> None:
        """Write the page, the table and the list of failures, of all parts."""
        from semgs.batch.overview import scene_of, write_overview
        from semgs.batch.records import read_record, write_failures

        found = [(task, read_record(self.out, task.name)) for task in tasks]
        records = [record if record and record.fingerprint == task.fingerprint else None for task, record in found]
        write_failures(self.out, [record for record in records if record])
        scenes = [
            scene_of(self.out, task.name, task.result, record) for task, record in zip(tasks, records, strict=True)
        ]
        write_overview(self.out, self.command, scenes)

    def _claim(self, paths: Sequence[Path], names: Sequence[str]) -> None:
        """Make OUT the folder of this command.

        Raises:
            InputError: it contains something else, another command has filled it, or the result of a scene would replace it.
            UsageError: it is in a scene, or in a folder that is searched for scenes.
        """
        from semgs.batch.records import FOLDER, PICTURES
        from semgs.batch.tasks import CAMERAS
        from semgs.files.atomic import write_json
        from semgs.files.claims import is_begun
        from semgs.files.folders import check_apart

        with readable(self.out):
            out = self.out.resolve()
        for path in paths:
            if out.is_relative_to((path.parent if path.name == CAMERAS else path).resolve()):
                raise UsageError(f"--out is in the scene {path}; name a folder elsewhere")
        for path in self._given():
            if out.is_relative_to(path.resolve()):
                raise UsageError(f"--out is in {path}, which is searched for scenes; name a folder elsewhere")
        settings, what = {"command": self.command}, "the results of a batch"
        with what_the_user_gave():
            try:
                begun = is_begun(self.out / SETTINGS, settings, what)
            except InputError:  # or another part has begun it just now
                begun = (self.out / SETTINGS).is_file() and is_begun(self.out / SETTINGS, settings, what)
                if not begun:
                    raise
        for path, name in zip(paths, names, strict=True):
            check_apart(self.out / self._result(name), [path])
        self.out.mkdir(parents=True, exist_ok=True)
        if not begun:
            write_json(self.out / SETTINGS, settings)
        for folder in (self.out / FOLDER, self.out / PICTURES):
            if folder.exists() and not folder.is_dir():
                raise InputError(folder, "a folder", "a file", advice="move it away")
            folder.mkdir(exist_ok=True)

    def _given(self) -> list[Path]:
        """The paths that DATA names."""
        return [path for word in self.data for path in _matching(word)]

    def _paths(self) -> list[Path]:
        """The scenes.

        Raises:
            InputError: there is none, or one of --scenes is missing.
        """
        from semgs.data.scene_lists import read_list, scenes_by_name

        given = self._given()
        wanted = read_list(self.scenes) if self.scenes else None
        found: list[Path] = []
        known: dict[str, Path] = {}
        for path in given:
            here = self._inputs_in(path, alone=len(given) == 1)
            found += here
            known = scenes_by_name(path, here) | known
        if not found:
            raise InputError(self.data[0], f"input of semgs {self.command}", "none")
        if wanted is not None:
            where = f"{given[0]} and {len(given) - 1} more" if len(given) > 1 else str(given[0])
            chosen = set(wanted.choose(known, where))
            found = [path for path in found if path in chosen]
        return list({path.resolve(): path for path in reversed(found)}.values())[::-1]

    def _inputs_in(self, path: Path, alone: bool) -> Sequence[Path]:
        """The inputs of the command at a path. A path without one is left to the command, which will say why it fails, unless it is the only path.

        Raises:
            InputError: there is no input.
        """
        if self.command in ("reconstruct", "doctor", "label"):
            return self._scenes_in(path, alone)
        if not path.exists():
            raise InputError(path, f"input of semgs {self.command}", found_at(path))
        if self.command != "export" or (path / SCENE).is_file():
            return [path]
        inside = sorted(one.parent for one in path.glob(f"*/{SCENE}"))
        beside_results = path.name in RESERVED and (path.parent / SETTINGS).is_file()
        return inside if inside or beside_results or (alone and path.is_dir()) else [path]

    def _scenes_in(self, path: Path, alone: bool) -> Sequence[Path]:
        """The scenes at a path. One that is none is left to the command, unless it is the only path: then it is no set of scenes either.

        Raises:
            InputError: there is no scene.
        """
        from semgs.data.scenes import scene_paths
        from semgs.sfm.photos import has_only_photos

        try:
            return scene_paths(path)
        except InputError:
            if not path.exists() or (alone and not has_only_photos(path)):
                raise
            return [path]

    def _names(self, paths: Sequence[Path]) -> list[str]:
        """A name for each scene.

        Raises:
            UsageError: a scene is given twice, or has a name that we need or that is too long.
        """
        from semgs.batch.tasks import scene_names

        with what_the_user_gave():
            names = scene_names(paths)
        if taken := set(RESERVED) & {self._result(name) for name in names}:
            raise UsageError(f"the result of a scene would be named {min(taken)}, which we need; rename the scene")
        longest = max(names, key=_bytes_of)
        if _bytes_of(longest) > LONGEST_NAME:
            raise UsageError(
                f"the scene {shortened(longest, 60)} has a name of {_bytes_of(longest)} bytes; at most {LONGEST_NAME} fit, so rename the scene"
            )
        return names

    def _result(self, name: str) -> str:
        """What the command writes for a scene."""
        return name + ENDINGS.get(self.command, "")

    def _task(self, path: Path, name: str, given: Run) -> Task:
        """The task of a scene."""
        from semgs.batch.tasks import task_of

        return task_of(self.command, given, path, name, self.out, self._result(name))

    def _parse(self, options: Sequence[str]) -> Run:
        """The options of the command, of no scene in particular.

        Raises:
            UsageError: they cannot be parsed, or are ours to set.
        """
        from semgs.batch.tasks import PLACES
        from semgs.cli.main import COMMANDS

        for word in options:
            if word.partition("=")[0] in ("--overwrite", "--page"):
                raise UsageError(f"{word} is not for semgs batch, which sets it for each scene")
        out = f"--{PLACES[self.command][1]}"
        return parse(COMMANDS[self.command].load(), f"semgs {self.command}", [ANY, out, ANY, *options])


class Pace:
    """Reports how a batch proceeds: on a terminal beside the bar, else a line each minute; and each failure.

    Args:
        total: number of scenes to run.
        show: takes the number of finished scenes and a few words.
    """

    def __init__(self, total: int, show: Callable[[int, str], None]) -> None:
        self.total, self.show = total, show
        self.finished = self.failed = 0
        self.start = self.reported = time()

    def add(self, record: Record) -> None:
        """Count a scene."""
        self.finished += 1
        if not record.succeeded:
            self.failed += 1
            print(f"{record.name}: {record.why}", flush=True)
        words = f"{self.failed} failed, {self._expected_end()}"
        self.show(self.finished, words)
        if time() - self.reported >= MINUTE and self.finished < self.total and not sys.stderr.isatty():
            self.reported = time()
            print(f"{self.finished:,} of {self.total:,} scenes, {words}", flush=True)

    def _expected_end(self) -> str:
        """When the last scene will be done at this pace."""
        left = (time() - self.start) / self.finished * (self.total - self.finished)
        return f"expected end {strftime('%a %H:%M', localtime(time() + left))}"
