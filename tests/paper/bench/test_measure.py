from __future__ import annotations

from paper.bench import measure as module
from paper.bench.measure import WHOLE, CannotMeasureError, measure


def runs(log: list[str], seconds: dict[str, float]):
    def run(name: str):
        log.append(name)
        return {WHOLE: seconds[name], "part": seconds[name] / 2}

    return {name: (lambda name=name: run(name)) for name in seconds}


def test_after_the_warm_ups_everything_is_run_in_turns() -> None:
    log: list[str] = []
    found = measure(runs(log, {"a": 1.0, "b": 2.0}), repeats=3, warm_ups=2)
    assert log == ["a", "a", "b", "b", "a", "b", "a", "b", "a", "b"]
    assert found == {
        "a": [{WHOLE: 1.0, "part": 0.5}] * 3,
        "b": [{WHOLE: 2.0, "part": 1.0}] * 3,
    }


def test_five_repeats_after_two_warm_ups_are_the_rule() -> None:
    log: list[str] = []
    found = measure(runs(log, {"a": 0.1}))
    assert len(log) == 7
    assert len(found["a"]) == 5


def test_what_takes_long_is_measured_once() -> None:
    log: list[str] = []
    found = measure(runs(log, {"slow": module.BEYOND_SECONDS + 1, "fast": 0.1}))
    assert log.count("slow") == 1
    assert found["slow"] == [{WHOLE: 21.0, "part": 10.5}]
    assert len(found["fast"]) == 5


def test_what_cannot_be_measured_does_not_stop_the_others() -> None:
    def fails() -> dict[str, float]:
        raise CannotMeasureError("no such thing here")

    found = measure({"a": fails, "b": lambda: {WHOLE: 1.0}})
    assert str(found["a"]) == "no such thing here"
    assert isinstance(found["b"], list)


def test_every_run_that_is_done_is_told() -> None:
    told: list[str] = []
    measure(runs([], {"a": 1.0, "b": 1.0}), repeats=2, warm_ups=1, done=told.append)
    assert told == ["a", "b", "a", "b", "a", "b"]
