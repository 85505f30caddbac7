"""The loop: a run that was cut anywhere ends with the bits of one that was not."""

from __future__ import annotations

import io
import json
import os
import resource
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from rich.console import Console

from semgs.files.errors import InputError
from semgs.training.data.batches import Portion
from semgs.training.loop import Feed, fit, resume
from semgs.training.run.checkpoints import best_checkpoint, newest_checkpoint, save_checkpoint
from semgs.training.run.log import Events
from semgs.training.run.session import Session
from semgs.training.state import TrainingState
from semgs.training.supervision.supervision import make_supervision
from semgs.training.supervision.validation import validation_of_views


class Killed(BaseException):
    """Stands for kill -9: nothing in the loop may catch it."""


@pytest.fixture
def session(network, batch, settings, tmp_path):
    """One session of a run: begins or goes on, and may be cut before a step."""

    def sit(
        out: Path,
        *,
        cut: int | None = None,
        ask_to_stop: int | None = None,
        every: int = 6,
        init: str = "random",
        minutes: float | None = None,
        save_minutes: float = 5.0,
        console: Console | None = None,
        validation: list | None = None,
    ) -> TrainingState:
        out.mkdir(exist_ok=True)
        state = TrainingState.begin(
            network(), make_supervision(settings), settings.learning_rate, settings.average_decay
        )
        resume(state, out, newest_checkpoint(out / "checkpoints"))

        def batches() -> Iterator[Portion]:
            for step in range(state.step, settings.steps):
                if step == cut:
                    raise Killed
                if step == ask_to_stop:
                    os.kill(os.getpid(), signal.SIGTERM)
                yield Portion((batch(step),))

        settings_here, feed = (
            replace(settings, validate_every=every, init=init),
            Feed(batches(), [batch(1000), batch(1001)] if validation is None else validation),
        )
        fit(
            state, settings_here, out, feed, Session(minutes, save_minutes, state.seconds),
            validate_every=settings_here.validate_every, validate_start=settings_here.init != "random", console=console,
        )  # fmt: skip
        return state

    return sit


def same(a: TrainingState, b: TrainingState) -> bool:
    mine, theirs = a.tensors(), b.tensors()
    return mine.keys() == theirs.keys() and all(torch.equal(mine[name], theirs[name]) for name in mine)


def test_a_run_killed_twice_and_gone_on_with_gives_the_same_bits(session, tmp_path):
    whole = session(tmp_path / "whole")
    for cut in (5, 9):
        with pytest.raises(Killed):
            session(tmp_path / "cut", cut=cut, save_minutes=0.0)
    parts = session(tmp_path / "cut")
    assert parts.step == 12
    assert same(whole, parts)


def test_a_run_killed_between_checkpoints_goes_on_from_the_last_one(session, tmp_path):
    whole = session(tmp_path / "whole")
    session(tmp_path / "cut", minutes=0.0)
    assert newest_checkpoint(tmp_path / "cut" / "checkpoints").numbers["step"] == 1
    with pytest.raises(Killed):
        session(tmp_path / "cut", cut=5)
    assert newest_checkpoint(tmp_path / "cut" / "checkpoints").numbers["step"] == 1
    assert same(whole, session(tmp_path / "cut"))


def test_sigterm_ends_the_session_after_its_step_with_a_checkpoint(session, tmp_path):
    handler = signal.getsignal(signal.SIGTERM)
    state = session(tmp_path / "run", ask_to_stop=4)
    assert state.step == 5
    assert newest_checkpoint(tmp_path / "run" / "checkpoints").numbers["step"] == 5
    assert signal.getsignal(signal.SIGTERM) is handler


class Stopping(list):
    """Batches that send the process a signal after the first one, in the 1st, 2nd and 4th iteration."""

    iterations = 0

    def __iter__(self) -> Iterator:
        self.iterations += 1
        for number, one in enumerate(super().__iter__()):
            if number == 1 and self.iterations in (1, 2, 4):
                os.kill(os.getpid(), signal.SIGTERM)
            yield one


def test_a_signal_ends_a_validation_and_the_next_session_begins_with_it(session, tmp_path, batch):
    def validations(run: str) -> list[dict]:
        lines = [json.loads(line) for line in (tmp_path / run / "log.jsonl").read_text().splitlines()]
        return [line for line in lines if "validation" in line]

    whole, stopping = session(tmp_path / "whole"), Stopping([batch(1000), batch(1001)])
    for step, due, validated in ((6, True, []), (6, True, []), (12, True, [6]), (12, False, [6, 12])):
        state = session(tmp_path / "cut", validation=stopping)
        assert (state.step, state.validation_due) == (step, due)
        assert [line["step"] for line in validations("cut")] == validated
    assert same(whole, state)
    assert validations("cut") == validations("whole")
    assert (state.best_step, state.best_score) == (whole.best_step, whole.best_score)
    assert newest_checkpoint(tmp_path / "cut" / "checkpoints").numbers == whole.numbers() | {"seconds": state.seconds}


def test_a_finished_run_is_left_as_it_is(session, tmp_path):
    session(tmp_path / "run")
    before = {path: path.stat().st_mtime_ns for path in (tmp_path / "run" / "checkpoints").iterdir()}
    session(tmp_path / "run")
    assert before == {path: path.stat().st_mtime_ns for path in (tmp_path / "run" / "checkpoints").iterdir()}


def test_a_finished_run_that_is_made_longer_has_the_learning_rate_of_the_longer_run(
    session, network, batch, settings, tmp_path
):
    """Step 12 of 20 is 12/19 down the cosine from 1e-2: (1 + cos(2.2619 - 0.2778)) / 2 = 0.299 of it; the last of 12 had 4e-8."""
    ended = session(tmp_path / "run")
    assert ended.optimizer.param_groups[0]["lr"] == pytest.approx(4e-8)
    state = TrainingState.begin(network(), make_supervision(settings), settings.learning_rate, settings.average_decay)
    resume(state, tmp_path / "run", newest_checkpoint(tmp_path / "run" / "checkpoints"))
    assert same(state, ended)
    outcome = fit(state, replace(settings, steps=20), tmp_path / "run", Feed([Portion((batch(12),))]), Session())
    assert (outcome.step, outcome.finished) == (13, False)
    assert state.optimizer.param_groups[0]["lr"] == pytest.approx(2.99e-3, rel=2e-3)


def test_a_truncated_checkpoint_is_passed_over_for_the_one_before(session, settings, network, tmp_path):
    whole = session(tmp_path / "whole")
    with pytest.raises(Killed):
        session(tmp_path / "cut", cut=6, save_minutes=0.0)
    folder = tmp_path / "cut" / "checkpoints"
    newest = folder / "00000006.safetensors"
    newest.write_bytes(newest.read_bytes()[:-7])
    checkpoint = newest_checkpoint(folder)
    assert checkpoint.numbers["step"] == 5
    assert checkpoint.damaged == (folder / "00000006.json",)
    assert same(whole, session(tmp_path / "cut"))


def test_the_last_three_checkpoints_stay_and_leftovers_of_a_kill_go(session, network, settings, tmp_path):
    folder = tmp_path / "checkpoints"
    folder.mkdir()
    (folder / ".00000001.safetensors.abcd.part").write_bytes(b"half")
    (folder / "00000002.safetensors").write_bytes(b"without its record")
    state = TrainingState.begin(network(), make_supervision(settings), settings.learning_rate, settings.average_decay)
    for state.step in (3, 5, 7, 9):
        save_checkpoint(folder, state)
    assert sorted(path.name for path in folder.iterdir()) == [
        f"0000000{step}.{suffix}" for step in (5, 7, 9) for suffix in ("json", "safetensors")
    ]


def test_the_checkpoint_of_the_best_validation_stays_until_a_better_one(session, tmp_path, monkeypatch):
    scores = iter([0.2, 0.5, 0.4, 0.3])
    monkeypatch.setattr(
        "semgs.training.supervision.supervision.Rendered.validate",
        lambda *given: validation_of_views(20.0, next(scores), 0.5, None),
    )
    session(tmp_path / "run", save_minutes=0.0, every=3)
    folder = tmp_path / "run" / "checkpoints"
    assert sorted(path.stem for path in folder.glob("*.json")) == ["00000006", "00000010", "00000011", "00000012"]
    newest = newest_checkpoint(folder)
    assert newest.numbers["best_score"] == 0.5
    assert best_checkpoint(folder, newest).numbers["step"] == 6


def test_a_run_that_goes_on_knows_the_best_score_of_before(session, tmp_path, monkeypatch):
    scores = iter([0.2, 0.5, 0.4, 0.3])  # of steps 3, 6, 9 and 12
    monkeypatch.setattr(
        "semgs.training.supervision.supervision.Rendered.validate",
        lambda *given: validation_of_views(20.0, next(scores), 0.5, None),
    )
    with pytest.raises(Killed):
        session(tmp_path / "run", cut=7, save_minutes=0.0, every=3)
    state = session(tmp_path / "run", save_minutes=0.0, every=3)
    assert (state.step, state.best_step, state.best_score) == (12, 6, 0.5)
    folder = tmp_path / "run" / "checkpoints"
    assert best_checkpoint(folder, newest_checkpoint(folder)).numbers["step"] == 6


def test_a_checkpoint_that_cannot_be_written_leaves_the_last_good_one(network, settings, tmp_path, monkeypatch):
    state = TrainingState.begin(network(), make_supervision(settings), settings.learning_rate, settings.average_decay)
    state.step = 4
    save_checkpoint(tmp_path, state)

    def full_disk(path: Path, data: bytes, durable: bool = False) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("semgs.training.run.checkpoints.write_bytes", full_disk)
    state.step = 5
    with pytest.raises(OSError, match="No space left"):
        save_checkpoint(tmp_path, state)
    assert newest_checkpoint(tmp_path).numbers["step"] == 4


def test_the_state_of_another_network_is_refused_by_name(session, settings, tmp_path):
    session(tmp_path, minutes=0.0)
    other = torch.nn.Conv2d(3, 5, 1)
    with pytest.raises(InputError, match="expected checkpoints of this network, found checkpoints of another one"):
        resume(
            TrainingState.begin(other, make_supervision(settings), settings.learning_rate, settings.average_decay),
            tmp_path,
            newest_checkpoint(tmp_path / "checkpoints"),
        )


def test_ten_broken_steps_in_a_row_end_the_run_and_keep_the_batch(network, batch, settings, tmp_path):
    state = TrainingState.begin(network(), make_supervision(settings), settings.learning_rate, settings.average_decay)
    state.model.register_forward_hook(lambda module, inputs, e: replace(e, depths=e.depths * float("nan")))
    with pytest.raises(FloatingPointError, match="10 steps in a row up to step 10"):
        fit(state, settings, tmp_path, Feed(Portion((batch(step),)) for step in range(12)), Session())
    assert (tmp_path / "bad_batch.safetensors").stat().st_size > 10_000


def test_the_log_has_each_step_once_and_the_validations_and_their_pictures(session, tmp_path):
    with pytest.raises(Killed):
        session(tmp_path / "run", cut=9, save_minutes=0.0)
    session(tmp_path / "run")
    lines = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    steps = [line["step"] for line in lines if "total" in line]
    checks = [line for line in lines if "validation" in line]
    assert steps == [9, 12]
    assert [line["step"] for line in checks] == [6, 12]
    assert 0 <= checks[0]["validation"]["miou"] <= 1
    assert {
        "total",
        "psnr",
        "gradient_norm",
        "samples_per_second",
        "wait_share",
        "seconds",
        "skipped",
        "bad_scenes",
        "memory_gb",
    } <= set(lines[-2])
    picture = np.asarray(Image.open(tmp_path / "run" / "validation" / "00000006.png"))
    assert picture.shape == (2 * 16, 6 * 24, 3)


def test_a_log_that_ran_ahead_of_the_checkpoint_loses_what_is_computed_again(session, tmp_path):
    session(tmp_path / "run", ask_to_stop=6)
    log = tmp_path / "run" / "log.jsonl"
    log.write_text(log.read_text() + '{"step": 9, "total": 1.0}\n{"step": 10, "tot')
    session(tmp_path / "run")
    assert [json.loads(line)["step"] for line in log.read_text().splitlines()] == [6, 7, 12, 12]


def test_a_run_that_starts_from_weights_is_validated_before_its_first_step(session, tmp_path, settings):
    session(tmp_path / "run", init="some.safetensors")
    session(tmp_path / "run", init="some.safetensors")
    lines = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines if "validation" in line] == [0, 6, 12]


def test_tensorboard_gets_the_numbers_of_the_log_and_the_pictures(session, tmp_path):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    with pytest.raises(Killed):
        session(tmp_path / "run", cut=9, save_minutes=0.0)
    session(tmp_path / "run")
    events = EventAccumulator(str(tmp_path / "run" / "tensorboard")).Reload()
    lines = [json.loads(line) for line in (tmp_path / "run" / "log.jsonl").read_text().splitlines()]
    for name in ("total", "psnr", "memory_gb"):
        told = [(event.step, event.value) for event in events.Scalars(f"training/{name}")]
        assert told == [(line["step"], pytest.approx(line[name], rel=1e-4)) for line in lines if name in line]
    assert [event.step for event in events.Scalars("validation/miou")] == [6, 12]
    assert (events.Images("validation")[0].width, events.Images("validation")[0].height) == (6 * 24, 2 * 16)


def test_events_that_do_not_fit_on_the_disk_raise_in_the_thread_that_writes_them(tmp_path, capfd):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60, limits[1]))  # a full disk for everybody
    try:
        with pytest.raises(OSError, match="File too large"):
            Events(tmp_path / "tensorboard", 0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.stat().st_size for path in (tmp_path / "tensorboard").iterdir()] == [60]
    assert capfd.readouterr().err == ""


def test_a_console_that_is_no_terminal_gets_plain_lines(session, tmp_path):
    console = Console(file=io.StringIO(), width=200)
    session(tmp_path / "run", console=console)
    told = console.file.getvalue()
    assert "step 12 of 12: loss" in told
    assert "min left" in told
    assert "validation PSNR" in told


def test_a_terminal_gets_a_bar_with_the_time_left(session, tmp_path):
    console = Console(file=io.StringIO(), width=160, force_terminal=True)
    session(tmp_path / "run", console=console)
    told = console.file.getvalue()
    assert "12/12" in told
    assert "PSNR" in told
