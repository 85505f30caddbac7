"""What is wrong with arguments is said in one line, whatever the terminal can show."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from paper_commands import main

from semgs.cli.arguments import parse
from semgs.cli.main import COMMANDS
from semgs.data.scene_details import SceneDetails
from semgs.run.options.scene_options import SceneOptions
from semgs.run.reconstruct import Reconstruct
from semgs.run.usage_errors import UsageError


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_a_wrong_value_is_told_alone_on_one_line(encoding: str):
    program = "import sys; from semgs.cli.main import main; sys.exit(main(['train', 'small', '--out', 'run', '--steps', '0']))"
    ended = subprocess.run(
        [sys.executable, "-c", program],
        capture_output=True,
        env=os.environ | {"PYTHONIOENCODING": encoding},
        check=False,
    )
    told = ended.stderr.decode()
    assert ended.returncode == 2
    assert told.count("\n") == 1
    assert "steps is 0; expected at least 1; see semgs train small --help" in told
    assert "----" not in told


@pytest.mark.parametrize(
    ("typed", "told"),
    [
        ("reconstruct scene --out out --veiws 3", "no option --veiws; did you mean --views?"),
        ("reconstruct scene --uot=out", "no option --uot; did you mean --out?"),
        (
            "train small --out run --losses.smothness 0",
            "no option --losses.smothness; did you mean --losses.smoothness?",
        ),
        ("train --out run small --step 3", "no option --step; did you mean --steps?"),
        ("train --out run small --steps 0", "steps is 0"),
        ("train small --out run --quux 3", "error: there is no option --quux; see semgs train small --help"),
        (
            "train --out run smal",
            "unknown preset 'smal'; did you mean small?; expected one of small, small_plain, base",
        ),
        (
            "ablate nope --out run --steps 9 --dry-run",
            "unknown preset 'nope'; expected one of small, small_plain, base, paper, base_text; see python -m paper.ablate --help",
        ),
        ("train --out run --steps 2", "semgs train needs a preset (small, small_plain, base, paper, base_text); see"),
        (
            "train --init small --out run",
            "semgs train needs a preset (small, small_plain, base, paper, base_text); see",
        ),
        ("train --out run", "semgs train needs a preset (small, small_plain, base, paper, base_text); see"),
        ("reconstruct scene --out out --quux 3", "error: there is no option --quux; see semgs reconstruct --help"),
        ("evaluate small --data x --out run --refine 1 2", "error: --refine: expected at most one value, found 2; see"),
        ("recontruct scene --out out", "unknown command 'recontruct'; did you mean reconstruct?"),
        (
            "doctor scene --unit foo",
            "error: --unit: expected one of metric, unknown, found 'foo'; see semgs doctor --help",
        ),
        ("doctor scene --unit None", "error: --unit: expected one of metric, unknown, found 'None'; see semgs doctor"),
        ("doctor scene --depth-unit None", "error: --depth-unit: expected a number, found 'None'; see"),
        (
            "train small --out run --steps 1.5",
            "error: --steps: expected a whole number, found '1.5'; see semgs train small",
        ),
        ("train small --out run --contexts 1 b", "error: --contexts: expected a whole number, found 'b'; see"),
        ("train small --out run --contexts 1", "error: --contexts: expected 2 values, found 1; see"),
        ("train small --out run --learning-rate", "error: --learning-rate: expected one value, found none; see"),
        ("ablate small --out run --seeds a", "error: --seeds: expected a whole number, found 'a'; see"),
        ("doctor scene --intrinsics 1 2 3", "error: --intrinsics: expected 4 values, found 3; see semgs doctor --help"),
        ("doctor scene --intrinsics 1 2 3 x", "error: --intrinsics: expected a number, found 'x'; see"),
        ("doctor scene --intrinsics", "error: --intrinsics: expected 4 values, found none; see"),
        ("reconstruct scene --out out --all=perhaps", "error: --all: expected no value, found 'perhaps'; see"),
        (
            "export scene --out out --up --frame",
            "error: --up: expected one of auto, x, y, z, -x, -y, -z, found '--frame'; see",
        ),
        (
            "ablate small --out run --seeds",
            "error: --seeds: expected at least one value, found none; see python -m paper.ablate",
        ),
        ("evaluate small --data x --views --out run", "error: --views: expected at least one value, found none; see"),
        (
            "export scene --as x",
            "error: --as: expected one of ply, points, mcap, gltf, usd, colmap, objects, occupancy, mesh, mujoco, found 'x'",
        ),
    ],
)
def test_what_was_mistyped_is_named_with_the_nearest_that_there_is(
    typed: str, told: str, capsys: pytest.CaptureFixture[str]
):
    assert main(typed.split()) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line


@pytest.mark.parametrize(
    ("typed", "needed"),
    [
        ("reconstruct", "SCENE and --out DIR"),
        ("reconstruct scene", "--out DIR"),
        ("train", "a preset (small, small_plain, base, paper, base_text) and --out RUN"),
        ("train small", "--out RUN"),
        ("query", "SCENE, --embedding FILE and --out OUT"),
        ("poses", "PHOTOS and --out OUT"),
        ("poses photos", "--out OUT"),
        ("prepare scans --size 32x48", "--out OUT"),
        ("label scans", "--out OUT and --segmenter SEGMENTER"),
        ("label scans taught", "--segmenter SEGMENTER"),
    ],
)
def test_missing_arguments_are_named_without_their_help(typed: str, needed: str, capsys: pytest.CaptureFixture[str]):
    assert main(typed.split()) == 2
    program = f"semgs {typed}" if typed == "train small" else f"semgs {typed.split()[0]}"
    assert capsys.readouterr().err == f"semgs: error: {program} needs {needed}; see {program} --help\n"


WITH_LAST_WORD = {
    "poses": ("photos", "--focal 250"), "prepare": ("scans", "--size 32x48"), "label": ("scans", "--segmenter maps"), "rooms": ("", "--seed 3"),
}  # fmt: skip
"""Commands whose output may also be the last word: what comes before it, and options."""


@pytest.mark.parametrize("command", WITH_LAST_WORD)
def test_an_output_is_an_option_or_the_last_word(command: str):
    given, options = WITH_LAST_WORD[command]
    kind = COMMANDS[command].load()
    lines = (f"{given} --out a/b {options}", f"--out=a/b {options} {given}", f"{given} a/b {options}", f"{options} {given} a/b", f"{given} {options} a/b")  # fmt: skip
    first, *others = (parse(kind, "semgs", line.split()) for line in lines)
    assert first.out == Path("a/b")
    assert [type(one) for one in others] == [kind] * 4
    assert others == [first] * 4


@pytest.mark.parametrize("command", WITH_LAST_WORD)
@pytest.mark.parametrize("typed", ["{given} extra --out b {options}", "--out b {options} {given} extra", "{given} b {options} extra"])  # fmt: skip
def test_an_output_that_is_named_twice_is_refused(command: str, typed: str, capsys: pytest.CaptureFixture[str]):
    given, options = WITH_LAST_WORD[command]
    assert main([command, *typed.format(given=given, options=options).split()]) == 2
    told = f"expected one output, as --out OUT or as the last word; leave out extra; see semgs {command} --help"
    assert capsys.readouterr().err == f"semgs: error: {told}\n"


def test_a_word_too_many_is_no_output_where_only_an_option_names_it(capsys: pytest.CaptureFixture[str]):
    assert main(["reconstruct", "scene", "extra", "--out", "out"]) == 2
    assert capsys.readouterr().err == "semgs: error: unexpected argument 'extra'; see semgs reconstruct --help\n"


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("doctor nowhere", "a folder with a scene"),
        ("poses nowhere out", "a folder of photos, or a video"),
        ("label-splat nowhere --cameras . --out out", "a splat"),
        ("doctor . --images nowhere", "a folder of images"),
    ],
)
def test_a_path_with_nothing_there_is_refused_with_what_it_should_be(
    typed: str, expected: str, capsys: pytest.CaptureFixture[str]
):
    assert main(typed.split()) == 2
    assert capsys.readouterr().err.startswith(f"semgs: error: nowhere: expected {expected}, found nothing there; ")


def test_what_is_asked_of_a_scene_is_converted_once_and_refused_where_it_cannot_be():
    options = SceneOptions(camera="/left", intrinsics=(50.0, 51.0, 20.0, 10.0))
    options.check()
    assert options.asked is options.asked
    assert options.asked == SceneDetails(camera="/left", intrinsics=(50.0, 51.0, 20.0, 10.0))
    with pytest.raises(UsageError, match="depth_unit is -1"):
        SceneOptions(depth_unit=-1.0).check()


def test_paths_are_expanded_and_empty_ones_refused_as_they_are_typed(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    options = parse(Reconstruct, "semgs reconstruct", ["~/scan", "--out", "~"])
    assert (options.scene, options.out) == (tmp_path / "scan", tmp_path)
    for arguments, told in (
        (["", "--out", "out"], 'SCENE: "": expected a path, found an empty one'),
        (["scan", "--out", "~nosuchuser"], "--out: ~nosuchuser: expected a user nosuchuser, found none"),
    ):
        assert main(["reconstruct", *arguments]) == 2
        line = capsys.readouterr().err
        assert told in line
        assert line.count("\n") == 1


@pytest.mark.parametrize(
    ("option", "value", "why"),
    [("--frames", "0", "expected a whole number, 1 or more, found '0'"), ("--degrees", "x", "expected a number, found 'x'"),
     ("--size", "1x1", "expected sides from 32 to 4096 pixels, found 1x1")],
)  # fmt: skip
def test_a_wrong_value_of_an_option_that_may_be_left_out_is_said_without_types(option: str, value: str, why: str):
    from semgs.run.render import Render

    with pytest.raises(UsageError) as caught:
        parse(Render, "semgs render", ["a.ply", "--out", "a.mp4", option, value])
    assert str(caught.value) == f"{option}: {why}; see semgs render --help"


def test_words_that_begin_with_a_dash_are_values_where_they_are_numbers_or_choices():
    from semgs.run.export import Export
    from semgs.run.render import Render

    assert parse(Export, "semgs export", ["scene", "--out", "out", "--up", "-z"]).up == "-z"
    assert parse(Render, "semgs render", ["a.ply", "--out", "a.mp4", "--degrees", "-20"]).degrees == -20.0
    options = parse(Reconstruct, "semgs reconstruct", ["--out", "out", "--depth-range", ".5", "1e1", "--", "-scan"])
    assert (options.scene, options.depth_range) == (Path("-scan"), (0.5, 10.0))


def test_an_option_that_is_given_again_counts_last_and_several_values_add_up():
    options = parse(
        Reconstruct, "semgs reconstruct", ["scan", "--out", "a", "--out", "b", "--context", "1", "2", "--context", "5"]
    )
    assert (options.out, options.context) == (Path("b"), (1, 2, 5))


@pytest.mark.parametrize(
    "typed",
    ["evaluate small --data x --out run --workers 0 --segmenter maps", "evaluate small --data x --out run --single --protocol neighbours",
     "export scene --out out --as points --colour photo", "view scene --html a.html --port 8080"],
)  # fmt: skip
def test_an_option_that_is_given_its_default_goes_with_all(typed: str):
    name, *arguments = typed.split()
    kind = COMMANDS[name].load()
    assert isinstance(parse(kind, f"semgs {name}", arguments), kind)
