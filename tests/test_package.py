"""What is installed: the version, the wheel and what travels in it."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from email import message_from_bytes
from pathlib import Path

import pytest
import yaml
from index_page import page

import semgs

ROOT = Path(__file__).resolve().parent.parent


ROOMS = ROOT / "packages" / "semgs-rooms"


def built(root: Path, folder: Path) -> zipfile.ZipFile:
    """A wheel, built without a network."""
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    unknown = {name: value for name, value in os.environ.items() if name != "GITHUB_REPOSITORY"}
    subprocess.run(command, cwd=root, env=unknown, check=True, capture_output=True, timeout=120)
    (path,) = folder.glob("*.whl")
    return zipfile.ZipFile(path)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """That of SemGS."""
    return built(ROOT, tmp_path_factory.mktemp("wheel"))


@pytest.fixture(scope="module")
def rooms_wheel(tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """That of the rooms."""
    return built(ROOMS, tmp_path_factory.mktemp("rooms_wheel"))


def test_the_version_is_the_one_installed_and_cited():
    assert importlib.metadata.version("semgs") == semgs.__version__
    assert f"\nversion: {semgs.__version__}\n" in (ROOT / "CITATION.cff").read_text()
    assert re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[0] == semgs.__version__


README = "![a room](docs/room.gif) [Docs](docs/a.md#b), [torch](https://pytorch.org) and [above](#install)"


def test_without_an_address_the_page_on_an_index_has_no_links_to_files():
    assert page(README, None, "main") == " Docs, [torch](https://pytorch.org) and [above](#install)"


def test_with_one_they_lead_to_the_tag():
    assert page(README, "https://github.com/a/b", "v1") == (
        "![a room](https://github.com/a/b/raw/v1/docs/room.gif) [Docs](https://github.com/a/b/blob/v1/docs/a.md#b), "
        "[torch](https://pytorch.org) and [above](#install)"
    )


@pytest.mark.parametrize("which", ["wheel", "rooms_wheel"])
def test_the_page_of_a_wheel_leads_only_to_addresses(which: str, request: pytest.FixtureRequest):
    packed: zipfile.ZipFile = request.getfixturevalue(which)
    (name,) = [name for name in packed.namelist() if name.endswith(".dist-info/METADATA")]
    said = message_from_bytes(packed.read(name))
    assert said["Description-Content-Type"] == "text/markdown"
    text = packed.read(name).decode().split("\n\n", 1)[1]
    assert text.startswith("# ")
    assert [link for link in re.findall(r"\]\(([^)]*)\)", text) if not re.match("https?:|#", link)] == []


def test_only_the_step_that_publishes_may_identify_itself():
    """Trusted publishing: no password is kept anywhere, and what builds cannot publish."""
    workflow = yaml.safe_load((ROOT / ".github/workflows/release.yml").read_text())
    assert workflow[True] == {"push": {"tags": ["v*"]}}  # YAML reads "on" as true
    assert workflow["permissions"] == {}
    build, publish = workflow["jobs"]["build"], workflow["jobs"]["publish"]
    assert (build["permissions"], publish["permissions"]) == ({"contents": "read"}, {"id-token": "write"})
    assert publish["needs"] == "build"
    assert publish["environment"] == "release"
    assert "secrets." not in (ROOT / ".github/workflows/release.yml").read_text()


def test_the_public_names_are_there():
    names = {
        "Cameras",
        "Gaussians",
        "SavedScene",
        "Views",
        "load",
        "load_scene",
        "open_scene",
        "render",
        "save_ply",
        "save_scene",
    }
    assert names <= set(dir(semgs))
    for name in semgs.__all__:
        assert getattr(semgs, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'laod'"):
        _ = semgs.laod


def test_extras_are_named_as_they_are_installed_from_a_clone_since_the_package_is_on_no_index():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    files = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "semgs").rglob("*.py")]
    named = {
        extra
        for file in files
        for told in re.findall(r"pip install (?:-e )?(\S+\[[\w,]+\])", file.read_text())
        for extra in re.fullmatch(r"""["']\.\[(.+)\]""", told)[1].split(",")
    }
    assert {"cuda", "hub", "ros", "raycast", "train", "onnx", "litert", "segment"} <= named <= extras.keys()


def test_python_m_semgs_is_the_command():
    told = subprocess.run(
        [sys.executable, "-m", "semgs", "reconstruct", "nowhere", "--uot", "out"], cwd=ROOT, capture_output=True, text=True, check=False
    )  # fmt: skip
    assert told.returncode == 2
    assert told.stderr == "semgs: error: there is no option --uot; did you mean --out?; see semgs reconstruct --help\n"


def test_the_wheel_holds_every_file_of_the_package_and_nothing_else(wheel: zipfile.ZipFile):
    listed = subprocess.run(["git", "ls-files", "semgs"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    packed = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert set(listed.stdout.split()) - packed == set()
    assert all(name.startswith("semgs/") and "__pycache__" not in name for name in packed)


def test_rooms_are_a_wheel_of_their_own_with_the_same_version(rooms_wheel: zipfile.ZipFile):
    listed = subprocess.run(["git", "ls-files", "semgs_rooms"], cwd=ROOMS, capture_output=True, text=True, check=False)
    if listed.returncode:
        pytest.skip("not a git checkout")
    packed = {name for name in rooms_wheel.namelist() if ".dist-info/" not in name}
    assert packed == set(listed.stdout.split())
    (points,) = [name for name in rooms_wheel.namelist() if name.endswith("entry_points.txt")]
    assert "rooms = semgs_rooms.training_rooms" in rooms_wheel.read(points).decode()
    assert points.startswith(f"semgs_rooms-{semgs.__version__}.dist-info/")


WITHOUT_ROOMS = """
import sys
class Absent:
    def find_spec(self, name, *_):
        if name.split(".")[0] == "semgs_rooms":
            raise ModuleNotFoundError(name, name="semgs_rooms")
sys.meta_path.insert(0, Absent())
from semgs.cli.main import main
sys.exit(main(["rooms", "out"]))
"""


def test_the_command_that_makes_rooms_says_how_to_install_them(tmp_path: Path):
    command = [sys.executable, "-c", WITHOUT_ROOMS]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stderr == (
        "semgs: error: this command needs the package semgs-rooms: "
        "pip install -e packages/semgs-rooms in SemGS's folder\n"
    )
    assert done.returncode == 2


def test_the_wheels_hold_the_licence_and_the_command(wheel: zipfile.ZipFile, rooms_wheel: zipfile.ZipFile):
    names = wheel.namelist()
    assert any(name.endswith(".dist-info/licenses/LICENSE") for name in names)
    (theirs,) = [name for name in rooms_wheel.namelist() if name.endswith(".dist-info/licenses/LICENSE")]
    assert rooms_wheel.read(theirs) == (ROOT / "LICENSE").read_bytes()
    (points,) = [name for name in names if name.endswith("entry_points.txt")]
    assert "semgs = semgs.__main__:run" in wheel.read(points).decode()


def test_what_is_embedded_is_small(wheel: zipfile.ZipFile):
    sizes = {info.filename: info.file_size for info in wheel.infolist()}
    weights = {name: size for name, size in sizes.items() if name.endswith(".safetensors")}
    assert all(size <= 12e6 for size in weights.values())
    others = sum(size for name, size in sizes.items() if name not in weights and not name.endswith(".py"))
    assert others <= 1.5 * 2**20


def test_every_requirement_is_pinned():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    rooms = tomllib.loads((ROOMS / "pyproject.toml").read_text())
    extras = project["project"]["optional-dependencies"].values()
    asked = [*project["build-system"]["requires"], *project["project"]["dependencies"], *(r for e in extras for r in e)]
    asked += [one for one in rooms["project"]["dependencies"] if one != "semgs"]
    pinned = {line.split("==")[0].lower().replace("_", "-") for line in (ROOT / "constraints.txt").read_text().split()}
    names = {re.match(r"[\w.-]+", one)[0].lower().replace("_", "-") for one in asked}
    assert names <= pinned


def test_no_two_test_files_have_the_same_name():
    """pytest imports them by their names alone, and refuses the second."""
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert len(names) == len(set(names))
