"""The table of docs/lab/doctor.json on a few generated rooms: how often a planted mistake is named."""

from __future__ import annotations

from pathlib import Path

import pytest
from doctor_table import counted

from semgs.cli.main import main


@pytest.mark.long
def test_nine_of_ten_mistakes_in_rooms_are_named_and_few_good_scenes_raise_an_alarm(tmp_path: Path):
    rooms = tmp_path / "rooms"
    assert main(["rooms", str(rooms), "--scenes", "8", "--frames", "6", "--size", "240x320", "--seed", "5"]) == 0
    counts = counted(sorted(rooms.glob("scene_*")), 40)
    assert counts.right >= 36
    assert counts.told >= 0.9 * counts.undecidable
    assert counts.alarms <= 1
