"""The container: what the Dockerfile says and, in `make long`, its own steps in a folder with a fresh Debian. That takes no Docker, but root."""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from semgs.cli.commands.scenes.app import App
from semgs.cli.main import COMMANDS

ROOT = Path(__file__).resolve().parents[1]


def instructions(text: str) -> list[tuple[str, str]]:
    """Name and arguments of each instruction of a Dockerfile. Comments, and line ends within an instruction, are gone."""
    lines = re.sub(r"\s*\\\n\s*", " ", re.sub(r"^#.*\n", "", text, flags=re.MULTILINE)).splitlines()
    return [(name, rest.strip()) for name, _, rest in (line.partition(" ") for line in lines if line)]


STEPS = instructions((ROOT / "Dockerfile").read_text())


def arguments(name: str) -> list[str]:
    """Those of each instruction of this name."""
    return [rest for own, rest in STEPS if own == name]


def variables() -> dict[str, str]:
    """What ENV sets."""
    return dict(word.split("=", 1) for rest in arguments("ENV") for word in shlex.split(rest))


def test_instructions_are_read():
    text = "# one\nFROM debian\nRUN a \\\n    && b\n\nENV A=1 B='2 3'\n"
    assert instructions(text) == [("FROM", "debian"), ("RUN", "a && b"), ("ENV", "A=1 B='2 3'")]


def test_it_starts_the_app_as_an_ordinary_user():
    assert [name for name, _ in STEPS][-1] == "CMD"
    assert arguments("USER") == ["semgs"]
    assert "useradd --create-home semgs" in arguments("RUN")[0]
    program, command, *options = json.loads(arguments("CMD")[0])
    assert (program, options) == ("semgs", ["--host", "0.0.0.0"])
    assert command in COMMANDS
    assert arguments("EXPOSE") == [str(App.port)]


def test_it_installs_pinned_packages_and_torch_without_cuda():
    (install,) = [rest for rest in arguments("RUN") if "pip install" in rest]
    (required,) = re.findall(r"pip install -c /src/constraints\.txt '/src\[(\w+)\]'$", install)
    assert required in tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    assert variables()["PIP_EXTRA_INDEX_URL"].endswith("/cpu")


def test_it_holds_no_secrets_and_only_files_of_the_repository():
    assert {name for name, _ in STEPS} == {"FROM", "RUN", "ENV", "COPY", "USER", "WORKDIR", "EXPOSE", "CMD"}
    assert [name for name in variables() if re.search("token|secret|password|key", name, re.IGNORECASE)] == []
    copied = {word.rstrip("/") for rest in arguments("COPY") for word in rest.split()[:-1]}
    allowed = (ROOT / ".dockerignore").read_text().split("*\n", 1)[1]
    assert copied == set(re.findall(r"^!(.+)$", allowed, re.MULTILINE))
    assert [word for word in copied if not (ROOT / word).exists()] == []


def test_the_space_is_built_in_the_same_way_from_a_wheel():
    """A Space of the kind Gradio reads its requirements before it has other files, so it could not install a wheel."""
    steps = instructions((ROOT / "space/Dockerfile").read_text())
    for name in ("FROM", "ENV", "USER", "EXPOSE"):
        assert [rest for own, rest in steps if own == name] == arguments(name)
    system, install = (rest for name, rest in steps if name == "RUN")
    wheel = re.search(r"semgs-\S+\.whl", install)[0]
    assert [system, install.replace(wheel, "")] == [arguments("RUN")[0], arguments("RUN")[1].replace("/src[", "/src/[")]
    assert ("COPY", f"constraints.txt {wheel} /src/") in steps


class Container:
    """A folder with a fresh Debian, as far as the steps have come.

    Attributes:
        root: the folder.
        user, folder: who runs commands, and where.
        environment: variables for commands.
    """

    def __init__(self, root: Path) -> None:
        self.root, self.user, self.folder = root, "root", "/"
        self.environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LC_ALL": "C.UTF-8"}

    def command(self, *words: str) -> list[str]:
        """A command as process 1 of the container. Unlike a container of Docker, it has the network of this machine."""
        inside = 'mount -t proc proc "$0/proc" && exec "$@"'
        home = "/root" if self.user == "root" else f"/home/{self.user}"
        given = [f"{name}={value}" for name, value in {**self.environment, "HOME": home}.items()]
        root = str(self.root)
        return [
            *("unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", inside, root),
            *("chroot", f"--userspec={self.user}:{self.user}", root, "env", "-i", "-C", self.folder, *given, *words),
        ]

    def run(self, *words: str) -> None:
        """Run a command that must succeed."""
        done = subprocess.run(self.command(*words), capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout[-2000:]}\n{done.stderr[-4000:]}"

    def copy(self, sources: list[str], target: str) -> None:
        """COPY: files into a folder, folders as what is in them."""
        to = self.root / target.strip("/")
        to.mkdir(parents=True, exist_ok=True)
        for source in (ROOT / name for name in sources):
            if source.is_dir():
                shutil.copytree(source, to, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
            else:
                shutil.copy(source, to)

    def step(self, name: str, rest: str) -> None:
        """Run an instruction."""
        if name == "RUN":
            self.run("sh", "-c", rest)
        elif name == "ENV":
            self.environment |= dict(word.split("=", 1) for word in shlex.split(rest))
        elif name == "COPY":
            *sources, target = rest.split()
            self.copy(sources, target)
        elif name == "USER":
            self.user = rest
        elif name == "WORKDIR":
            self.folder = rest
        else:
            assert name in ("FROM", "EXPOSE", "CMD")


def fetched(*command: str, **environment: str) -> None:
    """Run a command that needs an index of packages; without one, skip the test."""
    done = subprocess.run(command, env={**os.environ, **environment}, capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip()).splitlines()[-1]
        pytest.skip(f"{Path(command[0]).name} could not fetch packages: {last}")


def wheels(folder: Path) -> None:
    """Fetch what the Dockerfile installs, for its Python 3.11."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    needed = [*project["build-system"]["requires"], *project["project"]["dependencies"]]
    for extra in re.findall(r"/src\[(\w+)\]", (ROOT / "Dockerfile").read_text()):
        needed += project["project"]["optional-dependencies"][extra]
    options = ["--retries", "0", "--python-version", "3.11", "--only-binary", ":all:", "-d", str(folder)]
    command = [sys.executable, "-m", "pip", "download", "-c", str(ROOT / "constraints.txt"), *options, *needed]
    fetched(*command, PIP_EXTRA_INDEX_URL=variables()["PIP_EXTRA_INDEX_URL"])


@pytest.fixture(scope="module")
def container() -> Iterator[Container]:
    """A container after all steps of the Dockerfile."""
    if shutil.which("debootstrap") is None:
        pytest.skip("there is no debootstrap here; install Debian's package debootstrap")
    if os.geteuid() or subprocess.run(["unshare", "--mount", "true"], capture_output=True, check=False).returncode:
        pytest.skip("only root can make a Debian in a folder and run programs there")
    with tempfile.TemporaryDirectory() as made:
        root = Path(made) / "root"
        image, release = re.fullmatch(r"(\w+):(\w+)-slim", arguments("FROM")[0]).groups()
        assert image == "debian"
        fetched("debootstrap", "--variant=minbase", release, str(root))
        wheels(root / "wheels")
        shutil.copy("/etc/resolv.conf", root / "etc/resolv.conf")
        made_here = Container(root)
        made_here.environment |= {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": "/wheels"}
        for step in STEPS:
            made_here.step(*step)
        shutil.rmtree(root / "wheels")
        yield made_here


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_its_user_makes_the_included_room(container: Container):
    container.run("semgs", "demo", "--html", "--out", "demo")
    made = container.root / "home/semgs/demo"
    assert (made / "scene.html").stat().st_size > 1e6
    assert (made / "report.html").stat().st_uid >= 1000
    installed = list((container.root / "opt/semgs/lib/python3.11/site-packages").glob("nvidia*"))
    assert installed == []


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_it_shows_the_page_of_the_app_to_those_with_the_token(container: Container):
    command = container.command(*json.loads(arguments("CMD")[0]), "--port", "0")
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process.stdout:
        try:
            said = next(line for line in process.stdout if line.startswith("Open "))
            (port, token) = re.search(r":(\d+)/\?token=(\S+) ", said).groups()
            address = f"http://127.0.0.1:{port}/"
            with pytest.raises(urllib.error.HTTPError, match="403"):
                urllib.request.urlopen(address)
            browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
            with browser.open(f"{address}?token={token}") as answer:
                assert "processed on this server" in answer.read().decode()
            (first,) = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
            os.kill(int(first), signal.SIGTERM)  # as `docker stop` does
            assert process.wait(60) == 128 + signal.SIGTERM
        finally:
            process.kill()
            process.wait()
