"""`semgs weights` and `semgs weights verify`."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from semgs.cli.main import main
from semgs.data.origin.terms import TermsWarning
from semgs.model.weights.header import SCORES as KEY
from semgs.model.weights.header import Figure, Score, scores_text
from semgs.model.weights.index import SHOWN, read_index
from semgs.model.weights.load import load, shipped
from semgs.model.weights.weights_file import save
from semgs.run.outcome import Outcome


def test_what_ships_is_listed_with_hash_and_licence(capsys: pytest.CaptureFixture[str]):
    assert main(["weights"]) == 0
    told = capsys.readouterr().out
    (small,) = [line for line in told.splitlines() if line.startswith("small  ")]
    count = sum(parameter.numel() for parameter in load("small").parameters())
    size = f"{shipped('small').stat().st_size / 1e6:.1f}"
    assert small.split()[1:] == [read_index()[0].sha256[:SHOWN], size, "MB", "Apache-2.0", f"{count:,}"]


def test_a_file_is_listed_with_its_scores(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    score = Score("val", "neighbours", 3, 96, "0" * 64, {"miou": Figure(0.5, 0.41, 0.6), "psnr": Figure(25.125)})
    save(tmp_path / "own.safetensors", load("small", "random"), {KEY: scores_text([score])})
    assert main(["weights", str(tmp_path / "own.safetensors")]) == 0
    told = capsys.readouterr().out
    assert "not stated" in told
    (row,) = [line for line in told.splitlines() if "val, 3 views" in line]
    assert row.endswith("96  0.500 [0.410, 0.600]  25.12")


def test_verify_says_what_matches(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "copy").write_bytes(shipped("small").read_bytes())
    assert main(["weights", "verify", "small", str(tmp_path / "copy")]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.startswith("small: sha256 ")
    assert " of small matches" in second


def test_verify_refuses_an_altered_file_on_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    content = bytearray(shipped("small").read_bytes())
    content[-7] ^= 1
    (tmp_path / "small.safetensors").write_bytes(content)
    assert main(["weights", "verify", str(tmp_path / "small.safetensors")]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert len(told.err.splitlines()) == 1
    assert "the file was changed" in told.err


def test_warnings_of_ours_are_one_line_of_the_terminal_and_others_stay(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    formatted: list[str] = []

    def run(options: object, progress: object) -> Outcome:
        formatted.extend(
            warnings.formatwarning(kind("said"), kind, "file.py", 7, "line") for kind in (TermsWarning, UserWarning)
        )
        return Outcome()

    monkeypatch.setattr("semgs.run.reconstruct.Reconstruct.run", run)
    usual = warnings.formatwarning
    assert main(["reconstruct", str(tmp_path), "--out", "none"]) == 0
    assert formatted == ["semgs: said\n", usual(UserWarning("said"), UserWarning, "file.py", 7, "line")]
    assert warnings.formatwarning is usual
