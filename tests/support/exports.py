"""`semgs export` as tests run it."""

from __future__ import annotations

from pathlib import Path

import pytest

from semgs.cli.main import main


def refused(capsys: pytest.CaptureFixture[str], scene: Path, out: Path, *options: object) -> str:
    """The line of a command that ends with exit code 2 and writes nothing."""
    capsys.readouterr()
    assert main(["export", str(scene), "--out", str(out), *map(str, options)]) == 2
    shown = capsys.readouterr()
    assert (shown.out, shown.err.count("\n")) == ("", 1)
    assert not out.exists()
    return shown.err
