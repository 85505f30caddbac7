"""The house: imports point down between floors, never up and never between packages of one floor."""

from __future__ import annotations

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

FLOORS = (
    ("files", "geometry"),
    ("data", "rendering"),
    ("model", "rooms", "capture"),
    ("weights", "objectives", "figures"),
    ("training", "reconstruction", "export"),
    ("evaluation", "viewer", "bench"),
    ("cli",),
)
"""From the ground up; `semgs` itself, which resolves the public names, stands above them all."""

FLOOR = {package: floor for floor, packages in enumerate(FLOORS) for package in packages}

INSIDE = {
    "evaluation": ("frames", "scoring", "tables", "page", "run"),
}
"""The folders and modules of packages that have an order of their own, from the ground up; what is not named keeps old names."""

VERSION = "semgs.__version__"
"""The one name of the top that every floor may read: it is set before anything is imported, and files carry it."""

OPTIONAL = (
    "pycolmap", "embreex", "gsplat", "viser", "lightning_fabric", "mitsuba", "pyoidn", "sklearn", "tensorboard",
    "huggingface_hub", "lpips", "rosbags",
)  # fmt: skip
"""Libraries that an extra brings: each is imported in one module, inside the function that needs it."""


def modules(root: Path) -> dict[str, Path]:
    """Every module below root/semgs by its dotted name."""
    found = {}
    for path in sorted((root / "semgs").rglob("*.py")):
        parts = path.relative_to(root).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def tree(text: str) -> ast.Module:
    """The syntax tree of a module's text."""
    return ast.parse(text)


def imported(name: str, path: Path) -> list[str]:
    """The dotted names that a module imports, wherever in it, also through `import_module("...")`."""
    names = []
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in ast.walk(tree(path.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            # `from semgs import data` names a package, `from semgs import load` the top itself.
            names += [f"{base}.{alias.name}" if base == "semgs" else base for alias in node.names]
        elif isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if called in ("import_module", "__import__") and isinstance(node.args[0].value, str):
                names.append(node.args[0].value)
    return names


def package_of(name: str) -> str | None:
    """The package of the house that a dotted name lies in; "" for the top, None outside the house."""
    parts = name.split(".")
    if parts[0] != "semgs":
        return None
    return parts[1] if len(parts) > 1 and parts[1] in FLOOR else ""


def wrong_arrows(root: Path) -> list[str]:
    """Every import that points up, sideways or to the top."""
    wrong = []
    for name, path in modules(root).items():
        home = package_of(name)
        if home == "":
            continue
        for target in imported(name, path):
            there = package_of(target)
            if there is None or there == home or target == VERSION:
                continue
            if there == "" or home is None or FLOOR[there] >= FLOOR[home]:
                wrong.append(f"{name} imports {target}")
    return wrong


def wrong_arrows_inside(root: Path, package: str) -> list[str]:
    """Every import inside a package that points up in its order of `INSIDE`."""
    level = {f"semgs.{package}.{part}": number for number, part in enumerate(INSIDE[package])}

    def part_of(name: str) -> str:
        return ".".join(name.split(".")[:3])

    wrong = []
    for name, path in modules(root).items():
        for target in imported(name, path) if part_of(name) in level else ():
            if target.split(".")[:2] == ["semgs", package] and level.get(part_of(target), 99) > level[part_of(name)]:
                wrong.append(f"{name} imports {target}")
    return wrong


def test_imports_point_down_only():
    assert wrong_arrows(ROOT) == []


@pytest.mark.parametrize("package", INSIDE)
def test_imports_inside_a_package_point_down_only(package: str):
    assert wrong_arrows_inside(ROOT, package) == []
    folders = {path.name for path in (ROOT / "semgs" / package).iterdir() if any(path.glob("*.py"))}
    assert folders <= set(INSIDE[package])


def test_a_planted_arrow_inside_a_package_is_found(tmp_path: Path):
    lines = {
        "page/report_page.py": "from semgs.evaluation.frames.plan import Plan",
        "frames/plan.py": "from semgs.evaluation.scoring import scores",
        "run.py": "from semgs.evaluation.page.report_page import report_page",
        "plan.py": "from semgs.evaluation.frames.plan import Plan",
        "tables/grid.py": "from semgs.evaluation.plan import Plan",
    }
    for name, line in lines.items():
        path = tmp_path / "semgs/evaluation" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(line)
    assert wrong_arrows_inside(tmp_path, "evaluation") == [
        "semgs.evaluation.frames.plan imports semgs.evaluation.scoring",
        "semgs.evaluation.tables.grid imports semgs.evaluation.plan",  # an old name
    ]


def test_the_package_imports_no_tools_and_release_work_no_commands():
    assert [
        name
        for name, path in modules(ROOT).items()
        if any(one.split(".")[0] == "tools" for one in imported(name, path))
    ] == []
    for path in (ROOT / "tools" / "release").glob("*.py"):
        assert not any(one.startswith("semgs.cli") for one in imported(f"tools.release.{path.stem}", path)), path


def test_every_folder_has_its_floor():
    folders = {path.name for path in (ROOT / "semgs").iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert folders <= set(FLOOR)


@pytest.mark.parametrize(
    ("module", "line", "found"),
    [
        ("data/views.py", "from semgs.model.semgs import SemGS", "semgs.model.semgs"),
        ("model/heads.py", "import semgs.rooms.room", "semgs.rooms.room"),
        ("model/heads.py", "def f():\n    from semgs import rooms", "semgs.rooms"),
        ("rendering/render.py", "from semgs.model.encoding import Encoding", "semgs.model.encoding"),
        ("geometry/cameras.py", "from semgs import load", "semgs.load"),
        ("geometry/cameras.py", "from ..files.errors import InputError", "semgs.files.errors"),
        ("export/ply.py", "import_module('semgs.cli.main')", "semgs.cli.main"),
        ("export/ply.py", "if TYPE_CHECKING:\n    from semgs.training.loop import train", "semgs.training.loop"),
    ],
)
def test_a_planted_arrow_is_found(tmp_path: Path, module: str, line: str, found: str):
    good = {
        "semgs/__init__.py": "from semgs.model.heads import Head",
        "semgs/model/heads.py": "import torch\nfrom semgs.data.views import Views\nfrom semgs.model.cnn import CNN",
        "semgs/data/views.py": "from semgs.geometry.cameras import Cameras\nfrom . import classes",
    }
    for name, text in good.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert wrong_arrows(tmp_path) == []
    planted = tmp_path / "semgs" / module
    planted.parent.mkdir(parents=True, exist_ok=True)
    planted.write_text(line)
    name = "semgs." + module.removesuffix(".py").replace("/", ".")
    assert wrong_arrows(tmp_path) == [f"{name} imports {found}"]


def at_heads(libraries: tuple[str, ...]) -> dict[str, str]:
    """Modules that import one of the libraries outside of functions: module to library."""
    found = {}
    for name, path in modules(ROOT).items():
        for node in tree(path.read_text()).body:
            if isinstance(node, ast.ImportFrom):
                targets = [node.module or ""]
            else:
                targets = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for target in targets:
                if target.split(".")[0] in libraries:
                    found[name] = target
    return found


def test_optional_libraries_are_imported_in_functions_only():
    assert at_heads((*OPTIONAL, "trimesh")) == {}


def test_the_command_line_alone_imports_its_parser():
    users = {package_of(name) for name, path in modules(ROOT).items() if "tyro" in imported(name, path)}
    assert users == {"cli"}


def test_numba_is_imported_at_the_head_of_kernels_and_of_the_back_end_that_holds_them_only():
    assert [name for name in at_heads(("numba",)) if not name.endswith(("_kernels", "_backend"))] == []


def test_each_optional_library_has_one_home():
    homes: dict[str, set[str]] = {}
    for name, path in modules(ROOT).items():
        for target in imported(name, path):
            if target.split(".")[0] in OPTIONAL:
                homes.setdefault(target.split(".")[0], set()).add(name)
    assert {library: sorted(names) for library, names in homes.items() if len(names) > 1} == {}


def test_neither_the_package_nor_its_files_nor_its_help_import_torch():
    files = [name for name in modules(ROOT) if package_of(name) == "files"]
    lines = [
        f"import sys, semgs, semgs.cli.main, {', '.join(files)}",
        "semgs.cli.main.main(['--help'])",
        "print(sorted({'torch', 'numba'} & set(sys.modules)))",
    ]
    told = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True, cwd=ROOT, timeout=120
    )
    assert told.stdout.splitlines()[-1] == "[]"


@pytest.mark.long
def test_a_reconstruction_waits_for_no_library_that_takes_seconds_to_import(tmp_path):
    """torch's compiler, which `torch.library.custom_op` would import, and torchmetrics: three and four seconds."""
    lines = [
        "import sys, semgs.cli.main",
        f"semgs.cli.main.main(['demo', '--out', {str(tmp_path / 'out')!r}])",
        "print(sorted({'torch._dynamo', 'torchmetrics', 'scipy.spatial', 'scipy.stats', 'tensorboard'} & set(sys.modules)))",
    ]
    told = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True, cwd=ROOT, timeout=240
    )
    assert (tmp_path / "out" / "report.json").exists()
    assert told.stdout.splitlines()[-1] == "[]"
