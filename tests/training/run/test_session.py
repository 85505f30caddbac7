"""A session ends in time."""

from __future__ import annotations

import pytest

from semgs.training.run.session import Session, time_waiting


@pytest.fixture
def clock(monkeypatch):
    """A clock that stands still until it is set forward [s]."""

    class Clock:
        now = 100.0

        def pass_by(self, seconds: float) -> None:
            self.now += seconds

    clock = Clock()
    monkeypatch.setattr("semgs.training.run.session.time.monotonic", lambda: clock.now)
    return clock


def test_it_ends_before_a_step_and_a_checkpoint_that_would_take_too_long(clock):
    session = Session(minutes=2.0, save_minutes=0.5, before=1000.0)
    clock.pass_by(10)
    assert session.end_step() == 1010
    assert not session.save_due
    clock.pass_by(25)
    assert session.end_step() == 1035
    assert session.save_due
    session.time_save(lambda: clock.pass_by(20))
    assert not session.save_due
    # 55 s have passed; the longest step took 25 and the checkpoint 20, which the weights may take again: 120 - 25 - 40 = 55.
    assert session.over
    clock.now -= 0.5
    assert not session.over


def test_without_an_end_it_goes_on(clock):
    session = Session(minutes=None, save_minutes=5.0, before=0.0)
    clock.pass_by(1e9)
    assert not session.over


def test_waiting_is_measured_and_working_is_not(clock):
    def items():
        for number in range(2):
            clock.pass_by(3)
            yield number

    waited = []
    for _, seconds in time_waiting(items()):
        clock.pass_by(50)
        waited.append(seconds)
    assert waited == [3, 3]
