"""Types of options: each accepts what it names, and refuses the rest with what was expected and what was found."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import pytest

from semgs.cli.arguments import parse
from semgs.cli.main import main
from semgs.run.options.types import (
    AutoSize,
    Count,
    Device,
    Minutes,
    Protocol,
    SeveralViews,
    Size,
    Weights,
    WeightsOrRandom,
    Workers,
)  # fmt: skip
from semgs.run.reconstruct import Reconstruct
from semgs.run.usage_errors import UsageError


@dataclass
class Options:
    """One option of each type."""

    size: Size = (240, 320)
    auto: AutoSize = None
    device: Device = "auto"
    weights: Weights = "small"
    start: WeightsOrRandom = None
    protocol: Protocol = ("neighbours",)
    views: SeveralViews = (2,)
    count: Count = 1
    workers: Workers = 0
    minutes: Minutes = None


def parsed(*typed: str) -> Options:
    return parse(Options, "program", typed)


def test_what_is_typed_becomes_what_a_command_uses(tmp_path: Path):
    file = tmp_path / "frames.json"
    file.write_text("{}")
    assert parsed() == Options()
    options = parsed(
        "--size", "32x4096", "--auto", "48×64", "--device", "cpu", "--weights", str(file), "--start", "random", "--protocol", "pinned",
        str(file), "--views", "2", "4", "--count", "3", "--workers", "0", "--minutes", "0.5",
    )  # fmt: skip
    assert options == Options(
        (32, 4096), (48, 64), "cpu", str(file), "random", ("pinned", str(file)), (2, 4), 3, 0, 0.5
    )
    assert parsed("--auto", "auto").auto is None
    assert parsed("--weights", "hf://a/b").weights == "hf://a/b"


@pytest.mark.parametrize(
    ("typed", "told"),
    [
        ("--size auto", "--size: expected height x width in pixels, such as 240x320, found 'auto'"),
        ("--size 31x64", "--size: expected sides from 32 to 4096 pixels, found 31x64"),
        ("--auto 64", "--auto: expected height x width in pixels, such as 240x320, found '64'"),
        ("--device mps", "--device: mps is not supported yet: it has no float64, which cameras need; use cpu"),
        ("--device tpu", "--device: expected one of auto, cpu, cuda, found 'tpu'"),
        (
            "--protocol neighbors",
            "--protocol: expected one of neighbours, peers, pairs, aside, lsm \\[FILE\\], pinned FILE, found 'neighbors'",
        ),
        (
            "--protocol pinned",
            "--protocol: expected a FILE after pinned, the frames.json or report.json of an evaluation, found none",
        ),
        ("--protocol peers 7", "--protocol: expected one of .*, found 'peers 7'"),
        ("--views 2 1", "--views: expected a whole number, 2 or more, found '1'"),
        ("--views 2.5", "--views: expected a whole number, 2 or more, found '2.5'"),
        ("--count 0", "--count: expected a whole number, 1 or more, found '0'"),
        ("--workers=-1", "--workers: expected a whole number, 0 or more, found '-1'"),
        ("--minutes 0", "--minutes: expected more than 0, found '0'"),
        ("--minutes nan", "--minutes: expected more than 0, found 'nan'"),
    ],
)
def test_what_cannot_be_used_is_refused_on_one_line(typed: str, told: str):
    with pytest.raises(UsageError, match=f"^{told}; see program --help$") as caught:
        parsed(*typed.split())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("command", "wanted"),
    [
        ("export out --out map --as occupancy --resolution inf", "finite number, more than 0"),
        ("export out --out map --as occupancy --robot-height inf", "finite number, more than 0"),
        ("poses photos scene --focal inf", "finite number, more than 0"),
        ("train small --out run --cache-gib inf", "finite number, 0 or more"),
    ],
)
def test_lengths_and_sizes_are_not_infinite(command: str, wanted: str, capsys: pytest.CaptureFixture[str]):
    assert main(command.split()) == 2
    assert f"{command.split()[-2]}: expected a {wanted}, found 'inf'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("typed", "told"),
    [
        ("--weights nowhere", "nowhere: expected a file of weights, or small .*, found nothing there"),
        ("--weights random", "random: expected a file of weights, or small .*, found nothing there"),
        ("--weights .", r"\.: expected a file of weights, or small .*, found a folder"),
        (
            "--protocol pinned nowhere.json",
            "nowhere.json: expected a list of frames, such as frames.json, found no such file",
        ),
        (f"--weights {'n' * 400}", f"{'n' * 400}: expected a file of weights, or small .*, found nothing there"),
    ],
)
def test_files_that_are_not_there_are_named_in_full(typed: str, told: str):
    with pytest.raises(UsageError, match=f"^{told}$"):
        parsed(*typed.split())


@pytest.mark.parametrize(
    ("typed", "network", "weights"),
    [
        ("", "small", None),
        ("--weights small", "small", None),
        ("--weights FILE", "FILE", None),
        ("--weights random", "small", "random"),
        ("--weights random --model base", "base", "random"),
        ("--weights FILE --model base", "base", "FILE"),
        ("--model mvsplat", "mvsplat", None),
        ("--model small --weights small", "small", None),
    ],
)
def test_weights_say_which_network_they_are_for(typed: str, network: str, weights: str | None, tmp_path: Path):
    """A model has to be named only for random weights, and for a network that a checkpoint of MVSplat fills in part."""
    file = tmp_path / "weights"
    file.write_text("")
    words = ["scene", "--out", "out", *typed.replace("FILE", str(file)).split()]
    options = parse(Reconstruct, "semgs reconstruct", words)
    expected = (network.replace("FILE", str(file)), weights and weights.replace("FILE", str(file)))
    assert options._network_and_weights() == expected
