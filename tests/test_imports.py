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
    ("files", "geometry", "runtime"),
    ("rendering",),
    ("data",),
    ("scene", "sfm", "figures", "sources"),
    ("segmenters", "objectives", "robotics", "doctor", "mesh"),
    ("model", "splats", "depth_maps"),
    ("training", "export", "mapping"),
    ("evaluation", "viewer", "ros"),
    ("run",),
    ("batch", "app"),
    ("cli",),
    ("rooms",),
)
"""From the ground up; `semgs` itself, which resolves the public names, stands above them all. `rooms` is a distribution of its own, `semgs_rooms`, so nothing here may need it."""

ROOMS = Path("packages", "semgs-rooms", "semgs_rooms")
NAMES = {"rooms": "semgs_rooms"}
COMMANDS_OF_ROOMS = ("semgs_rooms.rooms_command", "semgs_rooms.furniture")
"""Its modules that use the command line, and with it what that reaches."""

LAYOUTS = "semgs.data.layouts"
LAYOUT_FLOORS = (
    ("parts",),
    ("colmap", "scannet"),
    (
        "scannetpp",
        "replica",
        "ros",
        "rgbd",
        "phones",
        "predictions",
        "transforms_json",
        "llff",
        "metashape",
        "labelled_images",
    ),
)
"""Inside `semgs.data.layouts`: what readers share, formats that other data sets use too, and the rest, which know nothing of one another, with their tables
of names."""

READERS_OF_LAYOUTS = (
    "semgs.data.scenes",
    "semgs.data.origin.licences",
    "semgs.data.preparation.prepared_set",
    "semgs.ros.messages",
)
"""Outside of that package only these import from it: what opens scenes, what knows the data sets' terms, what names prepared scenes, and what takes the messages
that bags have from a running robot."""

FLOOR = {package: floor for floor, packages in enumerate(FLOORS) for package in packages}

FOLDERS = {
    "rooms": ("pieces", "assets", "plans", "drawing", "sets", "furniture"),
    "evaluation": ("frames", "scoring", "tables", "page", "run", "single_images"),
    "model": (
        "layers", "settings", "switches", "networks", "attention", "classes", "sweep", "gaussians", "memory", "semgs", "build",
        "weights", "encode", "onnx",
    ),
}  # fmt: skip
"""Packages whose folders have an order too: modules of one import their own folder and those before it. Modules beside folders may take part."""

WITHOUT_NETWORK = (
    "segmenters", "robotics", "objectives", "doctor", "sfm", "rooms", "figures", "export", "viewer", "splats",
    "depth_maps", "mesh", "sources",
)  # fmt: skip
"""Packages that work on scenes and views, wherever these come from."""

MOST_MODULES = 18
"""So many Python files fit into one folder; with more, it needs folders of its own."""

VERSION = "semgs._version"
"""The one module beside the floors: it imports nothing, and every floor may read it, because files carry the version."""

OPTIONAL = (
    "pycolmap", "embreex", "gsplat", "viser", "lightning_fabric", "sklearn", "tensorboard",
    "huggingface_hub", "lpips", "rosbags", "onnxruntime", "ai_edge_litert", "transformers", "yaml", "av", "lzfse", "pillow_heif", "matplotlib",
    "gradio", "fastapi", "uvicorn", "rerun", "zstandard", "pxr", "OpenEXR", "ray", "onnx", "onnxscript",
    "skimage",
)  # fmt: skip
"""Libraries that an extra brings: each is imported in one module, inside the function that needs it."""


def modules(root: Path) -> dict[str, Path]:
    """Every module of both distributions below a root by its dotted name."""
    found = {}
    for folder in (root / "semgs", root / ROOMS):
        for path in sorted(folder.rglob("*.py")):
            parts = path.relative_to(folder.parent).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


@cache
def tree(text: str) -> ast.Module:
    """The syntax tree of a module's text."""
    return ast.parse(text)


@cache
def nodes(text: str) -> tuple[ast.Import | ast.ImportFrom | ast.Call, ...]:
    """The imports and calls in a module's text, found once for all tests."""
    return tuple(node for node in ast.walk(tree(text)) if isinstance(node, ast.Import | ast.ImportFrom | ast.Call))


def imported(name: str, path: Path) -> list[str]:
    """The dotted names that a module imports, wherever in it, also through `import_module("...")`."""
    names = []
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    for node in nodes(path.read_text()):
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


def modules_named(path: Path) -> set[str]:
    """What `from A import B` in a module names as A.B, which may be modules."""
    found = [node for node in nodes(path.read_text()) if isinstance(node, ast.ImportFrom)]
    return {f"{node.module}.{alias.name}" for node in found for alias in node.names}


def package_of(name: str) -> str | None:
    """The package of the house that a dotted name lies in; "" for the top, None outside the house."""
    parts = name.split(".")
    if parts[0] == "semgs_rooms":
        return "rooms"
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
    """Every import from a folder of a package that points to a later one, or to what is beside the folders."""
    above = NAMES.get(package, f"semgs.{package}")
    place = {f"{above}.{folder}": number for number, folder in enumerate(FOLDERS[package])}
    depth = above.count(".") + 2
    wrong = []
    for name, path in modules(root).items():
        home = ".".join(name.split(".")[:depth])
        if home not in place:
            continue
        for target in imported(name, path):
            there = ".".join(target.split(".")[:depth])
            if package_of(target) == package and place.get(there, len(place)) > place[home]:
                wrong.append(f"{name} imports {target}")
    return wrong


def wrong_arrows_of_layouts(root: Path) -> list[str]:
    """Every import inside `semgs.data.layouts` that points up or sideways, and every import of it by somebody who may not."""
    floor = {name: number for number, names in enumerate(LAYOUT_FLOORS) for name in names}
    wrong = []
    for name, path in modules(root).items():
        inside = name.startswith(f"{LAYOUTS}.")
        for target in imported(name, path):
            if not target.startswith(f"{LAYOUTS}."):
                continue
            home, there = (one.removeprefix(f"{LAYOUTS}.").split(".")[0] for one in (name, target))
            may = home == there or floor[there] < floor[home] if inside else name in READERS_OF_LAYOUTS
            if not may:
                wrong.append(f"{name} imports {target}")
    return wrong


def reached(root: Path, package: str) -> set[str]:
    """The modules that a package imports, directly or through others, wherever in their text."""
    known, reached = modules(root), set()
    ahead = [name for name in known if package_of(name) == package and not name.startswith(COMMANDS_OF_ROOMS)]
    while ahead:
        name = ahead.pop()
        if name in reached:
            continue
        reached.add(name)
        ahead += {*modules_named(known[name]), *imported(name, known[name])} & known.keys()
    return reached


@pytest.mark.parametrize("package", WITHOUT_NETWORK)
def test_what_works_on_scenes_reaches_no_network(package: str):
    assert [name for name in reached(ROOT, package) if package_of(name) == "model"] == []


def test_a_planted_way_to_the_network_is_found(tmp_path: Path):
    texts = {
        "semgs/export/ply.py": "def f():\n    from semgs.scene import confidence",
        "semgs/scene/confidence.py": "from semgs.model.semgs import SemGS",
        "semgs/model/semgs.py": "import torch",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert reached(tmp_path, "export") == {"semgs.export.ply", "semgs.scene.confidence", "semgs.model.semgs"}


@pytest.mark.parametrize("package", FOLDERS)
def test_folders_of_a_package_form_no_ring(package: str):
    assert wrong_arrows_inside(ROOT, package) == []


def test_a_planted_arrow_inside_a_package_is_found(tmp_path: Path):
    texts = {
        "packages/semgs-rooms/semgs_rooms/sets/room_stream.py": "from semgs_rooms.drawing.room import Room\nfrom semgs_rooms.sets import cameras",
        "packages/semgs-rooms/semgs_rooms/drawing/room.py": "from semgs_rooms.sets.room_stream import sample\nfrom semgs.data.views import Views",
        "packages/semgs-rooms/semgs_rooms/pieces/solids.py": "import semgs_rooms.assets.asset_library\nfrom semgs_rooms.shared import Room",
        "packages/semgs-rooms/semgs_rooms/shared.py": "from semgs_rooms.drawing.room import Room",
    }
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert sorted(wrong_arrows_inside(tmp_path, "rooms")) == [
        "semgs_rooms.drawing.room imports semgs_rooms.sets.room_stream",
        "semgs_rooms.pieces.solids imports semgs_rooms.assets.asset_library",
        "semgs_rooms.pieces.solids imports semgs_rooms.shared",
    ]


def test_the_package_knows_nothing_of_the_repositorys_tools():
    users = [
        name
        for name, path in modules(ROOT).items()
        if any(one.split(".")[0] == "paper" for one in imported(name, path))
    ]
    assert users == []
    for path in (ROOT / "paper" / "release").glob("*.py"):
        assert not any(one.startswith("semgs.cli") for one in imported(f"paper.release.{path.stem}", path)), path


def test_imports_point_down_only():
    assert wrong_arrows(ROOT) == []


def test_readers_of_scenes_need_nothing_of_semgs_but_cameras_and_processes():
    """So that they can become a package of their own."""
    known = ("semgs.data.", "semgs.files.", "semgs.geometry.", "semgs.runtime.")
    wrong = [
        f"{name} imports {target}"
        for name, path in modules(ROOT).items()
        if name.startswith(known[:2])
        for target in imported(name, path)
        if target.startswith("semgs.") and not f"{target}.".startswith(known)
    ]
    assert wrong == []


def test_layouts_share_parts_and_know_nothing_of_one_another():
    assert wrong_arrows_of_layouts(ROOT) == []


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("data/layouts/parts/pose_files.py", "from semgs.data.layouts.colmap.colmap_files import read_images"),
        ("data/layouts/replica/sequence.py", "from semgs.data.layouts.rgbd.tum import open_tum"),
        ("training/loop.py", "from semgs.data.layouts.scannet.scannet_scan import open_scannet"),
    ],
)
def test_a_planted_arrow_between_layouts_is_found(tmp_path: Path, module: str, line: str):
    planted = tmp_path / "semgs" / module
    planted.parent.mkdir(parents=True)
    planted.write_text(line)
    assert len(wrong_arrows_of_layouts(tmp_path)) == 1


def rings(root: Path, package: str) -> dict[str, set[str]]:
    """The modules of a package that import one another in a ring, wherever in their text, and those that import these."""
    below: dict[str, set[str]] = {}
    known = modules(root)
    for name, path in known.items():
        if name.startswith(f"{package}."):
            below[name] = {*modules_named(path), *imported(name, path)} & known.keys()
    while leaves := [name for name, targets in below.items() if not targets & below.keys()]:
        for name in leaves:
            del below[name]
    return below


@pytest.mark.parametrize("package", sorted(FLOOR))
def test_modules_of_a_package_import_one_another_one_way(package: str):
    assert rings(ROOT, NAMES.get(package, f"semgs.{package}")) == {}


@pytest.mark.parametrize(
    "line", ["from semgs.data.resampling import resized", "def f():\n    from semgs.data import resampling"]
)
def test_a_planted_ring_is_found(tmp_path: Path, line: str):
    (tmp_path / "semgs" / "data").mkdir(parents=True)
    (tmp_path / "semgs" / "data" / "tables").mkdir(parents=True)
    (tmp_path / "semgs" / "data" / "tables" / "classes.py").write_text("")
    (tmp_path / "semgs" / "data" / "resampling.py").write_text("from semgs.data.views import Views")
    (tmp_path / "semgs" / "data" / "views.py").write_text(f"from semgs.data.tables.classes import IGNORE\n{line}")
    assert rings(tmp_path, "semgs.data").keys() == {"semgs.data.resampling", "semgs.data.views"}


@pytest.mark.parametrize("root", ["semgs", "scripts", "packages", "paper"])
def test_no_folder_has_more_than_18_modules(root: str):
    folders = [path for path in (ROOT / root).rglob("*") if path.is_dir()]
    assert {str(path): count for path in folders if (count := len(list(path.glob("*.py")))) > MOST_MODULES} == {}


def test_every_folder_has_its_floor():
    folders = {path.name for path in (ROOT / "semgs").iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert folders <= set(FLOOR) - set(NAMES)
    for package, ordered in FOLDERS.items():
        home = ROOT / ROOMS if package == "rooms" else ROOT / "semgs" / package
        folders = {path.name for path in home.iterdir() if (path / "__init__.py").exists()}
        assert folders <= set(ordered)


@pytest.mark.parametrize(
    ("module", "line", "found"),
    [
        ("data/views.py", "from semgs.model.semgs import SemGS", "semgs.model.semgs"),
        ("model/gaussians/heads.py", "import semgs.training.loop", "semgs.training.loop"),
        ("model/gaussians/heads.py", "def f():\n    from semgs import export", "semgs.export"),
        ("rendering/render.py", "from semgs.scene.encoding import Encoding", "semgs.scene.encoding"),
        ("geometry/cameras.py", "from semgs import load", "semgs.load"),
        ("geometry/cameras.py", "from semgs import __version__", "semgs.__version__"),
        ("geometry/cameras.py", "from ..files.errors import InputError", "semgs.files.errors"),
        ("export/ply.py", "import_module('semgs.cli.main')", "semgs.cli.main"),
        ("export/ply.py", "if TYPE_CHECKING:\n    from semgs.training.loop import train", "semgs.training.loop"),
    ],
)
def test_a_planted_arrow_is_found(tmp_path: Path, module: str, line: str, found: str):
    good = {
        "semgs/__init__.py": "from semgs.model.gaussians.heads import Head",
        "semgs/model/gaussians/heads.py": "import torch\nfrom semgs.data.views import Views\nfrom semgs.model.layers.cnn import CNN",
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


def test_the_command_line_alone_parses_and_what_it_runs_says_how_its_options_are_written():
    assert {package_of(name) for name, path in modules(ROOT).items() if "cyclopts" in imported(name, path)} == {"cli"}


def test_texts_in_files_are_utf_8_in_every_locale():
    calls = [
        (name, node)
        for name, path in modules(ROOT).items()
        for node in nodes(path.read_text())
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
    ]
    texts = [(name, node) for name, node in calls if getattr(node.func, "attr", "") in ("read_text", "write_text")]
    assert [name for name, node in texts if "encoding" not in [given.arg for given in node.keywords]] == []


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


def test_the_network_is_loaded_without_a_reader_of_scenes():
    line = "import sys, semgs; semgs.load; print(sorted(name for name in sys.modules if name.startswith('semgs.data.layouts')))"
    told = subprocess.run(
        [sys.executable, "-c", line], capture_output=True, text=True, check=True, cwd=ROOT, timeout=120
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
