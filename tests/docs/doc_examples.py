"""Reads the pages with sybil, and evaluates each of their examples: a command line, a block of Python, a block of JSON.

Everything runs on the disk of `reader_disk`, in the current folder. What would take long gets smaller numbers by the tables below, and nothing else changes.
"""

from __future__ import annotations

import json
import math
import re
import runpy
import shlex
import shutil
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import reader_disk
from float32_cameras import float32_cameras
from paper_commands import COMMANDS as WORKSHOP
from paper_commands import main
from sybil import Document, Example, Region
from sybil.parsers.markdown import CodeBlockParser

from semgs.cli.arguments import parse
from semgs.cli.main import COMMANDS
from semgs.data.scenes import open_scenes
from semgs.data.tables.class_files import read_class_file
from semgs.data.tables.class_groups import class_groups
from semgs.data.tables.classes import SCANNET20
from semgs.depth_maps.map_folder import MapRecord
from semgs.depth_maps.opening import read_depth_network
from semgs.evaluation.frames.frame_plan import read_plan
from semgs.files.records import make_record
from semgs.segmenters.exported import read_segmenter

ROOT = Path(__file__).resolve().parents[2]
PAGES = (ROOT / "README.md", *sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts))
MEASUREMENTS = tuple(sorted((ROOT / "docs" / "lab").glob("*.json")))
"""Tables of numbers with the commands that measured them."""

SKIPPED = {
    "python train.py": "the trainer of 3D Gaussian splatting's authors needs CUDA, and is on no index",
    "python simple_trainer.py": "gsplat's example needs CUDA, and is on no index",
    "ns-train": "nerfstudio needs CUDA",
    "npm install -g": "needs the network; `make long` installs the same program below tests/node",
    "scripts/recipe_small.sh": "eleven hours; test_recipe_small runs it with stand-ins",
}
"""Lines that no test runs, by how they begin, and why."""

SMALLER = {
    "batch": "--size 48x64 --workers 1",
    "ablate": "--steps 1 --size 32x48 --views 2 --workers 0 --test val24 --rooms 1",
    "bench": "--quick",
    "evaluate": "--size 48x64 --views 2",
    "evaluate --sides": "--sides 48 64",
    "evaluate --single": "--size 48x64",
    "export-network": "--size 48x64",
    "figure": "--size 48x64 --views 2",
    "label": "--size 48x64",
    "prepare": "--size 48x64 --workers 0",
    "reconstruct": "--size 48x64",
    "render": "--size 32x48 --frames 2",
    "rooms": "--scenes 1 --frames 2 --size 32x48 --workers 0",
    "train": "--steps 1 --size 32x48 --batch 1 --workers 0 --devices 1 --nodes 1 --accumulate 1",
    "weights calibrate": "--size 48x64",
    "examples/train_on_a_folder.py": "1 32 48",
    "tests/support/doctor_table.py": "--cases 2",
    "paper.release": "--data data/rooms --out failures.jpg",
}
"""Options that a command gets here: they replace those of the same name in the line, or are added."""

SMALLER_LISTS = {"scannet-sray-test": "some.txt", "scannet-1000-without-sray": "some.txt"}
"""Lists of scans that are replaced by one with fewer."""

SMALLER_IN_PYTHON = {
    "size=(240, 320)": "size=(32, 48)",
    "views=[2])": "views=[2], size=(48, 64))",
    "scenes=100": "scenes=1",
    "workers=4": "workers=0",
    "steps=4000": "steps=1, size=(32, 48), batch=1",
}
"""The same for blocks of Python."""

SLOW = (
    "app", "batch", "export-network", "label", "paper.", "poses", "train", "weights calibrate", "hf:", "models/", "--assets", "--sheet", "view",
    "kitchen_colmap", "splat-transform", "mosaic.tflite", "scripts/", "tests/", "--protocol neighbours", "--protocol lsm", "--free-space", "eval/other", "eval/segformer",
    "examples/train", "examples/score", "examples/robot", "examples/depth_maps_in", "--correspondence", "--weights runs/small", "--html", "--refine",
    "label-splat", "--rerun", "--single", "--features", "--all", "--camera", "--depth depth_maps", "--segmenter",
    "predictions.npz", "--protocol aside", "reconstruct photos", "reconstruct PHOTOS", "reconstruct recording",
)  # fmt: skip
"""Words of lines that run in `make long` only; in `make test` their options are parsed."""
SLOW_IN_PYTHON = ("train(", "open_library(", "make_plan(")

OUTPUTS = ("--out", "--html", "--json", "--page", "--fix", "--sheet", "--rerun")
"""Options whose file or folder is made by the command, so that it is not there before."""
OUTPUTS_IN_PYTHON = {"write_dataset(": "data/rooms", "train(": "runs/small"}

CARRIERS = ("ssh", "torchrun", "srun")
"""Programs that start a semgs command, whose options are parsed."""


def the_other_method(*inputs: object) -> np.ndarray:
    """A stand-in for the network of somebody else that a page names `their_model`: 21 logits for each pixel."""
    height, width = inputs[-2:]
    assert isinstance(height, int)
    assert isinstance(width, int)
    return np.broadcast_to(np.arange(21) % 21 == 5, (height, width, 21))


def read(path: Path) -> list[Example]:
    """The examples of a page, or the commands of a file of measurements, in its order."""
    if path.suffix == ".json":
        return list(Document.parse(str(path), measuring_commands))
    parsers = (command_lines, CodeBlockParser("python", python), CodeBlockParser("json", described))
    return list(Document.parse(str(path), *parsers))


def command_lines(document: Document) -> Iterator[Region]:
    """Each command line of the blocks of shell; comments are no commands, and a backslash joins two lines."""
    for block in CodeBlockParser("sh", shell)(document):
        start = document.text.index(block.parsed, block.start)
        for line in re.finditer(r"(?:[^\n]*\\\n)*[^\n]*\n?", block.parsed):
            if shlex.split(line[0], comments=True):
                yield Region(start + line.start(), start + line.end(), line[0], shell)


def measuring_commands(document: Document) -> Iterator[Region]:
    """The commands of a file of measurements."""
    for part in json.loads(document.text)["parts"]:
        for command in part.get("commands", ()):
            start = document.text.index(written := json.dumps(command, ensure_ascii=False))
            yield Region(start, start + len(written), command, shell)


def name(example: Example) -> str:
    """Page and line."""
    return f"{Path(example.path).relative_to(ROOT)}:{example.line}"


def skipped(example: Example) -> str | None:
    """Which entry of the list an example falls under."""
    return next(
        (start for start in SKIPPED if example.region.evaluator is shell and example.parsed.startswith(start)), None
    )


def slow(example: Example) -> bool:
    """Whether an example runs in `make long` only."""
    if example.region.evaluator is python:
        return any(word in example.parsed for word in SLOW_IN_PYTHON)
    words = words_of(example)
    if (
        "--help" in words
        or "--ray" in words
        or words[0] in {*CARRIERS, "sbatch", "make", "pip", "docker", "python3"}
        or words[:3] == ["python", "-m", "semgs_rooms.furniture"]
    ):
        return False
    return any(word in words[:2] if word.isalpha() else word in example.parsed for word in SLOW)


def form(example: Example) -> str:
    """What examples have in common that show the same: the command with the names of its options; else all words."""
    if example.region.evaluator is not shell:
        return example.parsed
    words = words_of(example)
    named = [word for word in words if word.startswith("--")]
    return " ".join(("semgs", command_of(words[1:])[0], *sorted(named)) if words[0] == "semgs" else words)


def quick(examples: Iterable[Example]) -> Iterator[Example]:
    """The examples that run in `make test`: of those with the same form the first."""
    forms = set()
    for example in examples:
        if not slow(example) and form(example) not in forms:
            forms.add(form(example))
            yield example


def words_of(example: Example) -> list[str]:
    """The words of a command line, as a shell hands them to the program of somebody who replaced the words in capitals."""
    words = [reader_disk.filled(word) for word in shlex.split(example.parsed.replace("\\\n", " "), comments=True)]
    found = [sorted(map(str, Path().glob(word))) or [word] if "*" in word else [word] for word in words]
    return [word.removeprefix(".venv/bin/") for several in found for word in several]


def shell(example: Example) -> None:
    """Run a command line, or check as much of it as can be checked without what it needs."""
    program, *rest = words = words_of(example)
    if program == "semgs":
        run_semgs(rest)
    elif program == "sbatch" and "--wrap" in rest:
        parse_semgs(shlex.split(rest[rest.index("--wrap") + 1].replace("$SLURM_ARRAY_TASK_ID", "1"))[1:])
    elif program == "sbatch":
        script = next(position for position, word in enumerate(rest) if (ROOT / word).is_file())
        parse_semgs(["batch", *rest[script + 1 :]])
    elif program in CARRIERS:
        parse_semgs(words[words.index("semgs") + 1 :])
    elif program == "make":
        subprocess.run(["make", "-n", *rest], cwd=ROOT, check=True, capture_output=True)
    elif program == "pip":
        check_pip(rest)
    elif program == "docker":
        check_docker(rest)
    elif program == "python3":
        assert rest == ["-m", "venv", ".venv"], f"python3 {' '.join(rest)}: only the making of .venv is known"
    elif program == "python":
        run_python(rest)
    elif program == "splat-transform":
        import node_tools

        node_tools.splat_transform(*rest)
    else:
        raise AssertionError(f"{program}: no rule says how to check this program")


def command_of(words: Sequence[str]) -> tuple[str, list[str]]:
    """The command's name, of one or two words, and the rest."""
    count = 2 if " ".join(words[:2]) in COMMANDS else 1
    return " ".join(words[:count]), list(words[count:])


def parse_semgs(words: Sequence[str]) -> None:
    """Parse the options of a semgs command."""
    name, rest = command_of(words)
    if name in WORKSHOP:
        parse(WORKSHOP[name], f"python -m paper.{name}", rest)
        return
    options = COMMANDS[name].load()
    if name == "batch":
        rest, others = options.split(rest)
        parse(COMMANDS[rest[0]].load(), f"semgs {rest[0]}", [rest[1], "--out", "out", *others])
    parse(options, f"semgs {name}", rest)


def run_semgs(words: Sequence[str]) -> None:
    """Run a semgs command with smaller numbers."""
    name, rest = command_of(words)
    if "--help" not in rest:
        parse_semgs(words)
    if name == "app":
        pytest.importorskip("gradio", reason="gradio is not installed; pip install -e '.[app]' in SemGS's folder")
        serve("app", *rest, "--port", "0", "--folder", "app")
        return
    if "--ray" in rest:  # it needs a cluster
        return
    if name == "view" and "--html" not in rest:
        serve("view", *rest)
        return
    kind = next((f" {word}" for word in ("--sides", "--single") if word in rest), "")
    options = SMALLER.get(f"{name}{kind}", "")
    rest = [SMALLER_LISTS.get(word, word) for word in smaller(rest, options)]
    if "camera_path.json" in rest:  # it says how many frames there are
        del rest[rest.index("--frames") :]
    if name == "rooms" and "--sheet" in rest:
        rest = list(words[1:])
    made = [rest[place + 1] for place, word in enumerate(rest) if word in OUTPUTS]
    with set_aside(made), float32_cameras() if name == "export-network" else nullcontext():
        code = main([*name.split(), *rest])
    assert code == 0, f"semgs {name} {shlex.join(rest)} ended with {code}"


def smaller(words: Sequence[str], options: str) -> list[str]:
    """Replace options with their values, or add them."""
    words = list(words)
    for option in re.findall(r"--\S+(?: [^-]\S*)*", options):
        first, *values = option.split()
        if first in words:
            place = words.index(first)
            end = next((n for n in range(place + 1, len(words)) if words[n].startswith("--")), len(words))
            words[place:end] = [first, *values]
        else:
            words += [first, *values]
    return words


@contextmanager
def set_aside(paths: Iterable[str]) -> Iterator[None]:
    """Let a command make files that are there already; afterwards they are as before."""
    kept = {Path(path): Path(f"{path}.aside") for path in paths if not path.startswith("-")}
    for path, aside in kept.items():
        if path.exists():
            path.rename(aside)
    try:
        yield
    finally:
        for path, aside in kept.items():
            if path.is_dir():
                shutil.rmtree(path)
            path.unlink(missing_ok=True)
            if aside.exists():
                aside.rename(path)


def serve(*words: str) -> None:
    """Start a command that serves a page, and stop it as soon as that can be opened."""
    command = [sys.executable, "-u", "-m", "semgs", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert any(line.startswith("Open http://") for line in process.stdout)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    assert process.returncode == 0


TORCH_FOR_CPUS = "https://download.pytorch.org/whl/cpu"
"""Where PyTorch has its builds without CUDA."""


def check_pip(words: Sequence[str]) -> None:
    """Extras exist, and what they and the line name is pinned."""
    assert words[0] == "install"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    pinned = {line.split("==")[0].lower() for line in (ROOT / "constraints.txt").read_text().split()}
    rest = iter(words[1:])
    for word in rest:
        if word == "-c":
            assert (ROOT / next(rest)).is_file()
        elif word == "--extra-index-url":
            assert next(rest) == TORCH_FOR_CPUS
        if word in ("-e", "-c", "--no-compile", "--extra-index-url") or (ROOT / word / "pyproject.toml").is_file():
            continue
        extras = re.fullmatch(r"\.(?:\[(.+)\])?", word)
        if extras is None:
            assert word.lower() in pinned, f"{word} is not in constraints.txt"
        for extra in extras[1].split(",") if extras and extras[1] else ():
            assert extra in project["optional-dependencies"], f"there is no extra {extra}"


def check_docker(words: Sequence[str]) -> None:
    """An image is built from the repository's Dockerfile, and its port is published."""
    steps = (ROOT / "Dockerfile").read_text()
    if words[0] == "build":
        assert words[1:] == ["--tag", "semgs", "."]
    else:
        assert words[0] == "run"
        assert words[-1] == "semgs"
        assert f"EXPOSE {words[words.index('--publish') + 1].split(':')[-1]}\n" in steps


def run_python(words: Sequence[str]) -> None:
    """Run a script, or a module of the repository, with smaller numbers."""
    if words[0] == "-m" and words[1].removeprefix("paper.") in WORKSHOP:
        run_semgs([words[1].removeprefix("paper."), *words[2:]])
        return
    if words[:2] == ["-m", "semgs_rooms.furniture"]:  # it needs Infinigen, so its options are parsed
        from semgs_rooms.furniture.__main__ import Furniture

        parse(Furniture, "python -m semgs_rooms.furniture", words[2:])
        return
    name = words[1] if words[0] == "-m" else words[0]
    assert words[0] == "-m" or (ROOT / name).is_file(), f"there is no {name}"
    if name.startswith("examples/"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", [name, *words[1:], *SMALLER.get(name, "").split()])
            runpy.run_path(str(ROOT / name), run_name="__main__")
        return
    command = [sys.executable, *smaller(words, SMALLER.get(name, ""))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def python(example: Example) -> None:
    """Run a block of Python; blocks of a page share their names."""
    text = example.parsed
    for usual, small in SMALLER_IN_PYTHON.items():
        text = text.replace(usual, small)
    example.namespace.setdefault("their_model", the_other_method)
    example.namespace.setdefault("header", SimpleNamespace(stamp=SimpleNamespace(sec=1, nanosec=2), frame_id="map"))
    example.namespace["__name__"] = "__main__"
    with set_aside(path for word, path in OUTPUTS_IN_PYTHON.items() if word in text):
        exec(compile("\n" * example.line + text, example.path, "exec"), example.namespace)


def described(example: Example) -> None:
    """Read a block of JSON as the files that it shows are read."""
    content, file = json.loads(example.parsed), Path("example.json")
    file.write_text(example.parsed)
    if content.get("format") == "semgs.frames":
        assert read_plan(file, open_scenes(Path("data/rooms"))).tasks
    elif "meaning" in content and "scaling" in content:
        read_depth_network(file)
    elif "meaning" in content:
        make_record(MapRecord, content)
    elif "scaling" in content:
        read_segmenter(file)
    elif "groups" in content:
        assert len(class_groups(str(file), SCANNET20.names).names) < len(SCANNET20)
    elif "classes" in content:
        read_class_file(file)
    elif "instance" in content:
        w, _, _, z = content["quaternion"]
        assert math.degrees(2 * math.atan2(z, w)) == pytest.approx(content["yaw_degrees"], abs=0.1)
    else:
        raise AssertionError("no reader of ours is known for this JSON")
