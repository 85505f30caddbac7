"""Run folders with damage: what was learned is never overwritten, and what cannot be read never counts."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from rich.console import Console

from semgs.files.errors import InputError
from semgs.training.loop import train
from semgs.training.run.checkpoints import newest_checkpoint, save_checkpoint
from semgs.training.run.execution import Execution
from semgs.training.run.log import DAMAGED, RunLog
from semgs.training.run.run_folder import (
    BEST,
    SETTINGS,
    WEIGHTS,
    claim_folder,
    read_settings,
    record_assets,
    start_network,
)
from semgs.training.state import TrainingState
from semgs.training.supervision.supervision import make_supervision
from semgs.training.supervision.validation import validation_of_views


@pytest.fixture
def state(network, settings) -> TrainingState:
    return TrainingState.begin(network(), make_supervision(settings), settings.learning_rate, settings.average_decay)


def save_at(folder: Path, state: TrainingState, *steps: int) -> None:
    for state.step in steps:
        save_checkpoint(folder, state)


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-7])


def steps_in(folder: Path) -> list[int]:
    return sorted(int(path.stem) for path in folder.glob("*.json"))


def content(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_run_whose_checkpoints_are_all_damaged_is_refused_and_left_as_it_is(state, settings, tmp_path):
    out = tmp_path / "run"
    claim_folder(out, settings)
    save_at(out / "checkpoints", state, 3, 6, 9)
    (out / "log.jsonl").write_text('{"step": 9}\n')
    for name in (WEIGHTS, BEST):
        (out / name).write_bytes(b"learned")
    (out / ".lock").touch()  # as every process that trains leaves it
    for record in (out / "checkpoints").glob("*.safetensors"):
        cut(record)
    before = content(out)
    with pytest.raises(
        InputError, match=r"3, all damaged; the newest is 00000009\.json; nothing was changed; .* --init"
    ):
        train(settings, out, Execution(workers=0))
    assert content(out) == before


def test_a_run_that_lost_its_checkpoints_keeps_its_weights(settings, tmp_path):
    (tmp_path / WEIGHTS).write_bytes(b"learned")
    with pytest.raises(
        InputError, match=rf"found none, but weights\.safetensors; .* --init {tmp_path / WEIGHTS} to keep"
    ):
        start_network(tmp_path, settings)


def test_damaged_checkpoints_do_not_count_among_the_last_three(state, tmp_path):
    """Of 5, 7, 9, 10 and 11, damaged at 9 and 10, the last three intact ones are 5, 7 and 11; with 12 they are 7, 11 and 12."""
    save_at(tmp_path, state, 5, 7, 9)
    cut(tmp_path / "00000009.safetensors")
    save_at(tmp_path, state, 10)
    cut(tmp_path / "00000010.safetensors")
    save_at(tmp_path, state, 11)
    assert steps_in(tmp_path) == [5, 7, 9, 10, 11]
    save_at(tmp_path, state, 12)
    assert steps_in(tmp_path) == [7, 9, 10, 11, 12]
    assert newest_checkpoint(tmp_path).numbers["step"] == 12


def test_a_run_that_went_back_keeps_what_it_writes(state, tmp_path):
    """Three damaged checkpoints of later steps were passed over; the numbers of the new ones are lower."""
    save_at(tmp_path, state, 20)
    save_at(tmp_path, state, 30, 31)
    for step in (30, 31):
        cut(tmp_path / f"000000{step}.safetensors")
    save_at(tmp_path, state, 21, 22)
    assert steps_in(tmp_path) == [20, 21, 22, 30, 31]
    assert newest_checkpoint(tmp_path).numbers["step"] == 22


@pytest.mark.parametrize(
    "change",
    [
        {"step": 4}, {"step": "5"}, {"step": True}, {"seconds": None}, {"skipped": -1}, {"skipped": 1.5}, {"best_step": 3},
        {"best_step": 3, "best_score": "0.5"}, {"sha256": 7},
    ],
)  # fmt: skip
def test_a_record_with_an_impossible_field_is_damaged(change, state, tmp_path):
    save_at(tmp_path, state, 3, 5)
    record = tmp_path / "00000005.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | change))
    assert newest_checkpoint(tmp_path).damaged == (record,)


@pytest.mark.parametrize("text", ["", "[]", "3", '{"step": ', "[" * 10**5, '{"step": %s}' % ("9" * 5000), '{"step": 5, "step": 5}'])  # fmt: skip
def test_a_record_that_is_no_record_is_damaged(text, state, tmp_path):
    save_at(tmp_path, state, 3, 5)
    (tmp_path / "00000005.json").write_text(text)
    assert newest_checkpoint(tmp_path).numbers["step"] == 3


@pytest.mark.parametrize(
    "text", ["", "3", "[]", '{"steps": "many"}', '{"losses": 3}', "[" * 10**5, '{"seed": %s}' % ("9" * 5000), '{"seed": 1, "seed": 2}']
)  # fmt: skip
def test_broken_settings_are_refused_in_one_line(text, tmp_path):
    (tmp_path / SETTINGS).write_text(text)
    with pytest.raises(InputError, match=r"settings\.json: expected the settings of a training run") as caught:
        read_settings(tmp_path)
    assert "\n" not in str(caught.value)


def test_broken_locks_of_assets_are_refused(tmp_path):
    (tmp_path / "assets.json").write_text('["a"')
    with pytest.raises(InputError, match=r"assets\.json: expected the locks of the assets of a run"):
        record_assets(tmp_path, [])


def test_damaged_lines_of_a_log_are_set_aside_and_the_run_goes_on(tmp_path):
    """A power cut leaves zeros; of the lines that can be read, those up to step 40 stay."""
    log = tmp_path / "log.jsonl"
    good = [b'{"step": 20, "total": 1.5}\n', b'{"step": 40, "total": 1.25}\n', b'{"step": 60, "total": 1.0}\n']
    bad = [b"\0" * 40 + b"\n", b"\xff\xfe\n", b'{"total": 1}\n', b'{"step": "40"}\n', b"[1]\n", b"[" * 10**5 + b"\n"]
    log.write_bytes(good[0] + bad[0] + bad[1] + good[1] + b"".join(bad[2:]) + good[2] + b'{"step": 80, "to')
    told = io.StringIO()
    with RunLog(tmp_path, 40, 100, Console(file=told, width=500)):
        pass
    assert log.read_bytes() == good[0] + good[1]
    assert (tmp_path / DAMAGED).read_bytes() == b"".join(bad)
    assert f"{log}: moved 6 unreadable lines to {DAMAGED}" in told.getvalue()
    with RunLog(tmp_path, 20, 100, None):
        pass
    assert log.read_bytes() == good[0]
    assert (tmp_path / DAMAGED).read_bytes() == b"".join(bad)


def test_a_run_that_begins_again_has_one_validation_of_its_first_weights(tmp_path):
    """Killed before its first checkpoint, it validates at step 0 again."""
    log = tmp_path / "log.jsonl"
    for score in (0.25, 0.5):
        with RunLog(tmp_path, 0, 100, None) as run:
            run.validation(0, validation_of_views(20.0, score, 0.75, None))
    (line,) = log.read_text().splitlines()
    assert json.loads(line) == {"step": 0, "validation": {"psnr": 20.0, "miou": 0.5, "accuracy": 0.75}}


def test_leftovers_of_killed_processes_go_before_a_run_resumes(settings, tmp_path):
    claim_folder(tmp_path, settings)
    for name in ("checkpoints/.00000003.json.1a2b3c4d.part", "validation/.00000002.png.1a2b3c4d.part"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_bytes(b"half")
    (tmp_path / "validation/00000001.png").write_bytes(b"complete")
    (tmp_path / WEIGHTS).write_bytes(b"learned")
    with pytest.raises(InputError, match=r"found none, but weights\.safetensors"):
        train(settings, tmp_path, Execution(workers=0))
    assert not list(tmp_path.rglob("*.part"))
    assert (tmp_path / "validation/00000001.png").read_bytes() == b"complete"
