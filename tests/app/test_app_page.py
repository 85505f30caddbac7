"""What the page says about photos and rooms."""

from __future__ import annotations

from pathlib import Path

import pytest

from semgs.app import page
from semgs.app.jobs import Job
from semgs.app.limits import Limits
from semgs.app.page import privacy_statement, status_text
from semgs.app.requests import Request

SIX_HOURS = Limits(kept_seconds=6 * 3600.0)


def test_a_server_says_which_photos_stay_and_for_how_long() -> None:
    said = privacy_statement(local=False, limits=SIX_HOURS)
    assert "except small copies of those that the room shows" in said
    assert said.endswith("the room is deleted after 6 hours.")
    assert privacy_statement(local=True, limits=SIX_HOURS) == "Your photos stay on this computer."


def test_a_room_that_is_ready_says_how_long_it_is_kept() -> None:
    job = Job("x", Path(), Request("example", [], "", {}), "a zip", state="done", started=10.0, ended=13.0)
    assert "Ready after 3 s. The room is kept for 6 hours at this address." in status_text(job, SIX_HOURS)


def test_of_very_many_uploads_that_somebody_follows_only_the_newest_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """gradio keeps something for each identifier that a browser asks for, for ever."""
    monkeypatch.setattr(page, "MOST_FOLLOWED", 3)
    kept = page.Newest(list)
    for name in "abcda":
        kept[name].append(name)
    assert dict(kept) == {"c": ["c"], "d": ["d"], "a": ["a"]}
