"""Where the base set has wheels: what uv says of a platform becomes the package that lacks one."""

from __future__ import annotations

import pytest

from paper.release import platforms
from paper.release.platforms import PLATFORMS, Platform, check_platforms, reason

SAID = """  × No solution found when resolving dependencies:
  cause: Because torch==2.13.0 has no wheels with a matching platform tag (e.g., `macosx_13_0_arm64`) and semgs
      depends on torch==2.13.0, we can conclude that your requirements are unsatisfiable.
"""


def test_the_package_without_a_wheel_is_named():
    assert reason(SAID) == "torch==2.13.0 has no wheel"
    assert (
        reason(SAID.replace("no wheels with a matching platform tag", "no usable wheels"))
        == "torch==2.13.0 has no wheel"
    )
    assert reason("no\nconnection") == "no connection"


@pytest.mark.parametrize(("lacking", "code"), [("", 0), ("macOS 14, Intel", 0), ("Windows x86-64", 1)])
def test_only_a_platform_that_has_to_work_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], lacking: str, code: int
):
    def said(platform: Platform, python: str) -> str | None:
        return "numba==0.68.1 has no wheel" if platform.name == lacking else None

    monkeypatch.setattr(platforms, "missing", said)
    assert check_platforms() == code
    printed = capsys.readouterr().out
    assert printed.count("| yes |") + printed.count("yes |") >= 3 * (len(PLATFORMS) - bool(lacking))
    assert printed.count("numba==0.68.1 has no wheel") == (3 if lacking else 0)
