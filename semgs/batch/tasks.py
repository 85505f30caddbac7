"""A scene of a batch: what to run for it, whether that is what was run before, and what a worker needs for it."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from semgs._version import __version__
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json
from semgs.run.label_splat import LabelSplat
from semgs.run.options.depth_options import MEASURED, OWN
from semgs.run.outcome import Run
from semgs.run.reconstruct import MOST_VIEWS, Reconstruct
from semgs.runtime.kept import stamps

CAMERAS = "transforms.json"
"""A scene in one file, whose photos are beside it."""

PLACES = {
    "reconstruct": ("scene", "out"), "poses": ("photos", "out"), "doctor": ("scene", "page"), "export": ("scene", "out"), "label": ("src", "out"),
    "label-splat": ("splat", "out"),
}  # fmt: skip
"""The options in which each command has its input and its output."""

WRITTEN = ("--rerun", "--fix")
"""Options that name a file to write: it is no input once it is there."""

NAME = "{name}"
"""What stands for the name of a scene in options."""


@dataclass(frozen=True)
class Task:
    """One scene of a batch.

    Attributes:
        name: of the scene.
        scene: its file or folder.
        out: the folder of the batch.
        result: what the command writes in it: "office", or "office.html".
        command: the command, such as "reconstruct".
        options: of the command, with this scene and its result.
        fingerprint: of these options and of what they read: other options or other photos have another one.
    """

    name: str
    scene: Path
    out: Path
    result: str
    command: str
    options: Run
    fingerprint: str


def task_of(command: str, given: Run, scene: Path, name: str, out: Path, result: str) -> Task:
    """The task of a scene.

    Args:
        command: to run.
        given: its options, of any scene; `NAME` in them stands for the name of this one.
        scene, name, out, result: as for `Task`.
    """
    source, target = PLACES[command]
    here = _named(given, name)
    said = [command, *_words({key: value for key, value in vars(here).items() if key not in (source, target)})]
    options = replace(here, **{source: _no_home(scene), target: _no_home(out / result)})
    return Task(name, scene, out, result, command, options, fingerprint(said, [scene]))


def _no_home(path: Path) -> Path:
    """The path, absolute if it would be taken for one in a home folder."""
    return path.absolute() if str(path).startswith("~") else path


def _named(value: Any, name: str) -> Any:
    """Options in which a scene's name is put in place of `NAME`."""
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{one.name: _named(getattr(value, one.name), name) for one in fields(value)})
    if isinstance(value, str | Path):
        return type(value)(str(value).replace(NAME, name))
    return tuple(_named(one, name) for one in value) if isinstance(value, tuple) else value


def _words(values: Mapping[str, Any]) -> list[str]:
    """Values by the name of their option as "--name=value", one for each part of a value."""
    words = []
    for name, value in values.items():
        if is_dataclass(value):
            words += _words(vars(value))
        else:
            option = name.replace("_", "-")
            words += [f"--{option}={one}" for one in (value if isinstance(value, tuple) else (value,))]
    return words


def fingerprint(options: Sequence[str], inputs: Sequence[Path]) -> str:
    """A hash of everything that decides the result of a task.

    Args:
        options: the command and its options, without the places of input and output. Files and folders among them, also as --option=PATH, count with
            what they contain, but for those to write.
        inputs: files and folders of the scene.
    """
    values = [
        word.partition("=")[2] if word.startswith("-") else word
        for before, word in pairwise(("", *options))
        if not {before, word.partition("=")[0]}.intersection(WRITTEN)
    ]
    named = [Path(value) for value in values if value and os.path.exists(value)]  # noqa: PTH110 - False for a word that is too long to be a path
    contents = [_changes(path) for path in (*inputs, *named)]
    text = json.dumps([__version__, list(options), contents])
    return hashlib.sha256(text.encode()).hexdigest()


def _changes(path: Path) -> tuple[tuple[str, int, int], ...]:
    """The stamps of a scene's files; a transforms.json counts with its folder and with the files elsewhere that it names.

    Photos are not read: a scan has gigabytes, and a batch a thousand scans.
    """
    path = path.absolute()
    place = path.parent if path.is_file() and path.name == CAMERAS else path
    files = sorted(path.glob("transforms*.json")) if path.is_dir() else [path] * (path.suffix.lower() == ".json")
    elsewhere = sorted({named for file in files for named in _named_in(file, place)})
    return stamps(place) + tuple(stamp for file in elsewhere for stamp in stamps(Path(file)))


def _named_in(file: Path, place: Path) -> list[str]:
    """The files that a JSON file names, from its folder on, but for those in a place; none if it is damaged, as the command will say."""
    with suppress(InputError):
        named = {os.path.normpath(file.parent / text.replace("\\", "/")) for text in _texts(read_json(file))}
        return [path for path in named if not path.startswith(f"{place}{os.sep}") and os.path.isfile(path)]  # noqa: PTH113 - False for a text that is too long to be a path
    return []


def _texts(content: Any) -> Iterator[str]:
    """The texts in the content of a JSON file."""
    if isinstance(content, str):
        yield content
    elif isinstance(content, list | dict):
        for part in content.values() if isinstance(content, dict) else content:
            yield from _texts(part)


def scene_names(paths: Sequence[Path]) -> list[str]:
    """A different name for each scene: that of its folder or file, after as many folders above it as it takes to tell it from others.

    If all are files of the same name in different folders, or a transforms.json, these are the names of their folders. A file that has the name of
    another, or of a folder, beside it keeps its ending: a.mp4 is a_mp4.

    Args:
        paths: files or folders.

    Raises:
        ValueError: a path is given twice.
    """
    paths = [path.absolute() for path in paths]
    apart = len({path.parent for path in paths}) == len(paths) > 1
    alike = apart and len({path.stem for path in paths}) == 1
    if all(path.is_file() and (alike or path.name == CAMERAS) for path in paths):
        paths = [path.parent for path in paths]
    plain = [path.with_suffix("") if path.is_file() else path for path in paths]
    beside = Counter(plain)
    names = [
        f"{path.stem}_{path.suffix[1:]}" if path.suffix and path.is_file() and beside[one] > 1 else one.name
        for path, one in zip(paths, plain, strict=True)
    ]
    parts = [list(path.parts[1:-1]) for path in paths]
    while len(set(names)) < len(names):
        taken = {name for name in names if names.count(name) > 1}
        if not any(parts[place] for place, name in enumerate(names) if name in taken):
            raise ValueError(f"the scene {sorted(taken)[0]} is given twice")
        names = [
            f"{parts[place].pop()}_{name}" if name in taken and parts[place] else name
            for place, name in enumerate(names)
        ]
    return names


PROCESS = {"poses": 2.0e9, "doctor": 1.0e9, "export": 1.0e9, "label": 1.0e9, "label-splat": 2.0e9}
"""Memory of a process of the other commands, measured at 240x320 and rounded up [bytes]."""

USUAL = (240, 320)
"""Size of the images if no option gives one: at most so many pixels."""

HELD_OUT = 4
"""Most views that are rendered besides the input views."""

MANY, VIEW_BYTES = 100, 120
"""Input views of a long recording, and what each adds per pixel: its photo, and its Gaussians after merging [bytes]."""

NETWORK = 1.0e9
"""Memory of a segmentation or depth network of another program [bytes]."""

CUDA_PROCESS, CUDA_CONTEXT = 3.0e9, 0.6e9
"""Memory of a process that uses CUDA, and what its libraries take on the GPU [bytes]."""


@dataclass(frozen=True)
class Demands:
    """What a worker needs, besides a core.

    Attributes:
        memory: peak of its process [bytes].
        gpu: the part of a GPU, 0 to 1; 0 computes on the CPU.
    """

    memory: float
    gpu: float = 0.0

    def workers(self, cores: int, free: float) -> int:
        """How many workers fit into a machine, at least one.

        Args:
            cores: that may be used.
            free: memory [bytes].
        """
        most = min(cores, free / self.memory)
        return max(1, int(min(most, 1 / self.gpu) if self.gpu else most))


def demands_of(command: str, given: Run) -> Demands:
    """What a worker needs for a command with its options."""
    if isinstance(given, Reconstruct):
        return _reconstructing(given)
    networks = command == "label" or (isinstance(given, LabelSplat) and given.segmenting.segmenter is not None)
    return Demands(PROCESS[command] + NETWORK * networks)


def _reconstructing(given: Reconstruct) -> Demands:
    """What a reconstruction needs, by the memory plan of its network."""
    import torch

    from semgs.model.memory.memory_plan import memory_plan
    from semgs.run.steps.pipeline import MOST_AT_ONCE

    uses_gpu = given.device == "cuda" or (given.device == "auto" and torch.cuda.is_available())
    model = given.load_network("cuda" if uses_gpu and torch.cuda.is_available() else "cpu")
    height, width = given.size or USUAL
    views = len(given.context) or given.views or (MANY if given.all else MOST_VIEWS)
    at_once = min(views, MOST_AT_ONCE)
    plan = memory_plan(model.work(at_once, (height, width), at_once + HELD_OUT), math.inf)
    peak = plan.peak_bytes + (views - at_once) * VIEW_BYTES * height * width
    networks = (given.segmenting.segmenter is not None) + (given.placing.depth not in (*MEASURED, OWN))
    peak += NETWORK * networks
    if not uses_gpu:
        return Demands(peak)
    if not torch.cuda.is_available():  # the cluster has GPUs, this machine has none
        return Demands(CUDA_PROCESS, 1.0)
    whole = torch.cuda.get_device_properties(0).total_memory
    return Demands(CUDA_PROCESS, min(1.0, math.ceil(100 * (peak + CUDA_CONTEXT) / whole) / 100))
