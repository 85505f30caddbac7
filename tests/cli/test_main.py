from __future__ import annotations

import subprocess
import sys

import pytest

import semgs
from semgs.cli.main import COMMANDS, main


def test_help_lists_the_commands_and_imports_no_torch() -> None:
    program = (
        "import sys; from semgs.cli.main import main; code = main(['--help']); "
        "code += main(['reconstruct', '--help']); assert 'torch' not in sys.modules; sys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=280, check=True)
    assert all(name in done.stdout for name in COMMANDS)
    assert done.stderr == ""


def test_the_help_of_reconstruct_explains_every_file_and_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reconstruct", "--help"]) == 0
    told = capsys.readouterr().out
    for part in (
        "report.html", "report.json", "gaussians.ply", "semantics.ply", "scene.safetensors", "renders/", "--out", "--views",
        "--context", "--size", "--model", "--weights", "--device", "--overwrite", "semgs reconstruct scans/office",
    ):  # fmt: skip
        assert part in told, part


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_every_command_has_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    assert f"Usage: semgs {name}" in capsys.readouterr().out


def test_the_version_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"semgs {semgs.__version__}\n"


def test_nothing_at_all_gives_the_help_and_code_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert "Usage: semgs COMMAND" in capsys.readouterr().err
