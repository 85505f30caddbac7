"""Rooms come from another package, which may not be there."""

from __future__ import annotations

from pathlib import Path

import pytest

from semgs.cli.main import main
from semgs.training.data import room_source as sources


class Moved:
    """The entry point of a package whose folder is gone."""

    def load(self) -> None:
        raise ModuleNotFoundError("No module named 'semgs_rooms'", name="semgs_rooms")


@pytest.fixture(params=["not installed", "its folder is gone"])
def without_rooms(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """No package says that it generates rooms, or one that is not there."""
    found = [] if request.param == "not installed" else [Moved()]
    monkeypatch.setattr(sources, "entry_points", lambda group: found)
    sources.room_source.cache_clear()


def test_another_library_that_is_missing_keeps_its_name(monkeypatch: pytest.MonkeyPatch):
    class Lacking:
        def load(self) -> None:
            raise ModuleNotFoundError("No module named 'embreex'", name="embreex")

    monkeypatch.setattr(sources, "entry_points", lambda group: [Lacking()])
    sources.room_source.cache_clear()
    with pytest.raises(ModuleNotFoundError, match="embreex"):
        sources.room_source()
    sources.room_source.cache_clear()


def test_the_installed_package_generates_rooms():
    views, targets = sources.room_source().samples(3, (24, 32), (2, 2), 1, length=4)[0]
    assert (len(views), len(targets), views.size) == (2, 1, (24, 32))


@pytest.mark.usefixtures("without_rooms")
@pytest.mark.parametrize("options", [[], ["--validation-scenes", "0"], ["--assets", "assets"]])
def test_a_training_that_needs_them_says_how_to_install_them(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(["train", "small_plain", "--size", "32x48", "--out", str(tmp_path / "run"), *options]) == 2
    (line,) = [one for one in capsys.readouterr().err.splitlines() if one.startswith("semgs: error: ")]
    assert line == f"semgs: error: {sources.MISSING}"
    assert not (tmp_path / "run").exists()
