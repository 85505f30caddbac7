"""`semgs train` as it is typed."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from semgs.cli.arguments import parse
from semgs.cli.commands.networks.train import Train
from semgs.cli.main import main
from semgs.objectives.loss_weights import DepthLossWeights
from semgs.run.usage_errors import UsageError
from semgs.training.presets import base, paper, preset_changes, small, small_plain
from semgs.training.supervision.supervision_settings import CLASS_WEIGHTINGS
from semgs.training.training_settings import differences


def parsed(line: str) -> Train:
    return parse(Train, "semgs train", line.split())


def test_a_preset_alone_is_the_preset():
    command = parsed("small --out run")
    assert differences(command.settings, small()) == {}
    assert command.out == Path("run")
    assert command.compute.minutes is None


def test_options_may_stand_before_and_behind_the_preset_and_override_it():
    command = parsed("--out run small --steps 70 --size 48x64 --losses.smoothness 0 --contexts 2 4 --minutes 3")
    assert (command.settings.steps, command.settings.size, command.settings.contexts) == (70, (48, 64), (2, 4))
    assert command.settings.losses.smoothness == 0
    assert command.settings.learning_rate == small().learning_rate
    assert command.compute.minutes == 3


@pytest.mark.parametrize("preset", ["small", "small_plain"])
@pytest.mark.parametrize("value", [False, True])
def test_a_flag_is_switched_on_and_off_whatever_the_preset_has(preset: str, value: bool):
    no = "" if value else "no-"
    settings = parsed(f"{preset} --out run --{no}context-targets --network.{no}class-backbone").settings
    assert (settings.context_targets, settings.network.class_backbone) == (value, value)


def test_supervision_by_depth_has_weights_of_its_own():
    command = parsed("--out run small --supervision depth --shared-rate 0 --depth-losses.gradients 0.25")
    assert (command.settings.supervision, command.settings.shared_rate) == ("depth", 0.0)
    assert command.settings.depth_losses == DepthLossWeights(log=1.3, gradients=0.25, distribution=0.1)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("small", "--out"),
        ("small --out run --size 48,64", "expected height x width in pixels"),
        ("small --out run --contexts 1 2", r"contexts is \(1, 2\)"),
        ("small --out run --steps 0", "steps is 0; expected at least 1"),
        ("small --out run --stops 3", "--stops"),
        ("small --out run --data scans=0", "data is 'scans=0'; expected rooms or DIR"),
        ("small --out run --validation scans=0", "validation is 'scans=0'; expected rooms or DIR"),
        (f"small --out run --seed {2**63}", rf"seed is {2**63}; expected 0 to 2\^63 - 1"),
        ("small --out run --class-weights 1 2", "expected 20 factors"),
        (
            f"small --out run --class-weights -1{' 1' * 19}",
            "expected a factor of 0 or more for each class of the table",
        ),
        (
            f"small --out run --class-weights nan{' 1' * 19}",
            "expected a factor of 0 or more for each class of the table",
        ),
        (f"small --out run --class-weights{' 0' * 20}", "not all of them 0"),
        ("small --out run --losses.colour -1", r"colour=-1.0.*expected weights of 0 or more"),
        ("small --out run --losses.smoothness nan", r"smoothness=nan.*expected weights of 0 or more"),
        (
            "small --out run --losses.semantic 0 --losses.colour 0 --losses.smoothness 0 --depth-weight 0",
            "one of them or of --depth-weight above 0",
        ),
        ("small --out run --depth-losses.log -1", r"log=-1.0.*expected weights of 0 or more"),
        (
            "small --out run --supervision depth --depth-losses.log 0 --depth-losses.gradients 0 --depth-losses.distribution 0",
            "one above 0 with --supervision depth",
        ),
        ("small --out run --depth-weight nan", "depth_weight is nan; expected 0 or more"),
        ("small --out run --learning-rate inf", "learning_rate is inf; expected a positive number"),
        ("small --out run --augmentation.crop 2", "augmentation: crop is 2.0; expected 0.2 to 1"),
        ("tiny --out run", "tiny"),
    ],
)
def test_what_cannot_be_is_told_on_one_line(line: str, told: str):
    with pytest.raises(UsageError, match=told) as caught:
        parsed(line)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("line", ["--minutes 0", "--workers -1", "--save-minutes -2"])
def test_a_sitting_that_cannot_be_is_refused(line: str, tmp_path: Path):
    with pytest.raises(UsageError, match=f"{line.split()[0]}: expected .* found"):
        parsed(f"small --out {tmp_path / 'run'} {line}").run()
    assert not (tmp_path / "run").exists()


def test_a_run_of_other_settings_ends_with_exit_code_2_and_the_difference(tmp_path: Path, capsys, monkeypatch):
    line = ["train", "small", "--out", str(tmp_path / "run")]
    monkeypatch.setattr("semgs.training.loop.launch", lambda *args, **options: pytest.skip("the run was accepted"))
    (tmp_path / "run").mkdir()
    from semgs.training.run.run_folder import claim_folder

    claim_folder(tmp_path / "run", small())
    (tmp_path / "run" / "weights.safetensors").touch()
    assert main([*line, "--steps", "77"]) == 2
    told = capsys.readouterr().err.strip().splitlines()
    assert told[-1].startswith("semgs: error: ")
    assert f"steps = {small().steps} there, 77 requested" in told[-1]


def test_what_differs_from_the_preset_is_told_in_words():
    settings = parsed("small --out run --steps 77 --seed 5 --augmentation.flip").settings
    assert preset_changes(settings) == [
        "augmentation: Augmentation(colour=0.0, crop=1.0, flip=True, roll=0.0, camera=0.0, exposure=0.0) "
        "(preset small: Augmentation(colour=0.0, crop=1.0, flip=False, roll=0.0, camera=0.0, exposure=0.0))",
        "seed: 5 (preset small: 0)",
        f"steps: 77 (preset small: {small().steps})",
    ]
    assert preset_changes(small()) == []


def test_a_preset_is_given_by_its_name():
    for preset in (small, small_plain, base):
        assert differences(parsed(f"{preset.__name__} --out run").settings, preset()) == {}
    settings = parsed("paper --out run --data scans rooms=0.5 --init weights.ckpt --devices 4").settings
    expected = replace(paper(), data=("scans", "rooms=0.5"), init="weights.ckpt")
    assert differences(settings, expected) == {}
    assert settings.preset == "paper"


def test_a_table_of_classes_travels_in_the_settings(tmp_path: Path):
    table = {"name": "two", "classes": [{"name": name, "colour": [1, 2, 3]} for name in ("wall", "floor")]}
    (tmp_path / "table.json").write_text(json.dumps(table))
    settings = parsed(f"small --out run --init small --classes {tmp_path / 'table.json'}").settings
    assert settings.classes is not None
    assert settings.classes.names == ("wall", "floor")
    assert preset_changes(settings)[0] == "classes: two (wall, floor) (preset small: none)"


def test_weights_of_a_loss_may_be_0_if_something_is_left_to_learn():
    nothing_rendered = "small --out run --losses.semantic 0 --losses.colour 0 --losses.smoothness 0"
    assert parsed(nothing_rendered).settings.depth_weight == 0.1  # the preset's
    assert parsed(f"{nothing_rendered} --supervision depth --depth-weight 0").settings.depth_losses.log == 1.3
    assert parsed(f"small --out run --class-weights 0{' 1' * 19}").settings.class_weights == (0.0, *[1.0] * 19)


def test_weights_of_classes_are_numbers_or_the_name_of_a_rule():
    line = "small --out run --class-weights"
    for rule in CLASS_WEIGHTINGS:
        assert parsed(f"{line} {rule}").settings.class_weights == rule
    assert parsed(f"{line} {'2.5 ' * 20}").settings.class_weights == (2.5,) * 20


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("paper --out RUN", "no data: give --data DIR"),
        ("paper --out RUN --data scans", "no weights to start from: give --init FILE"),
        ("small --out RUN --devices 3", "a step of 2 scenes cannot be shared by 3 processes"),
        ("small --out RUN --accumulate 0", "--accumulate: expected a whole number, 1 or more, found '0'"),
        ("small --out RUN --data nowhere", "nowhere: expected a folder with a scene, found nothing there"),
        ("small --out RUN --init nowhere.safetensors", "nowhere.safetensors: expected a weights file"),
        ("small --out RUN --init small --classes TABLE --data nowhere", "TABLE: expected a table of classes as JSON"),
        ("small_plain --out RUN --network.windows 0", "a branch has 0 windows; expected 1 or more along each side"),
        ("small_plain --out RUN --network.windows-semantic -1", "a branch has -1 windows"),
        ("small_plain --out RUN --network.cost-filter -1", "cost_filter is -1; expected 0 or more channels"),
        (
            "small_plain --out RUN --network.windows 5 --size 250x310",
            "--network.windows: expected a number that divides the 32x40 tokens of images of 250x310",
        ),
        (
            "small_plain --out RUN --scene-reuse 2 --contexts 2 11 --size 16x16 --workers 0",
            "--scene-reuse: expected at most 12 input and target views, which is what a room has, found 13",
        ),
    ],
)
def test_what_a_training_cannot_start_from_ends_with_exit_code_2_and_one_line(line: str, told: str, tmp_path, capsys):
    table = tmp_path / "table.json"
    assert main(["train", *line.replace("RUN", str(tmp_path / "run")).replace("TABLE", str(table)).split()]) == 2
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith("semgs: error: ")
    assert told.replace("TABLE", table.name) in last


@pytest.mark.parametrize(
    "mistyped", ["--data nowhere", "--init nowhere.pt", "--backbone nowhere.safetensors", "--teacher nowhere --supervision pictures", "--data ."]
)  # fmt: skip
def test_a_mistyped_input_does_not_block_the_folder_for_the_corrected_command(
    mistyped: str, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    line = ["train", "small", "--out", "run", "--steps", "2", "--device", "cpu", "--workers", "0", "--size", "32x48"]
    line += ["--batch", "1", "--validation-scenes", "0"]
    assert main([*line, *mistyped.split()]) == 2
    assert "semgs: error: " in capsys.readouterr().err

    def fitted(*args, **options):
        raise FloatingPointError("everything is ready")

    monkeypatch.setattr("semgs.training.loop.fit", fitted)
    assert main(line) == 2
    assert capsys.readouterr().err.splitlines()[-1] == "semgs: error: everything is ready"
    settings = json.loads(Path("run/settings.json").read_text())
    assert (settings["data"], settings["init"], settings["backbone"]) == (["rooms"], "random", "")
    assert settings["teacher"] == ""


def test_the_help_lists_the_settings_without_torch():
    lines = [
        "import sys",
        "from semgs.cli.main import main",
        "main(['train', 'small', '--help'])",
        "print('torch' in sys.modules)",
    ]
    told = subprocess.run([sys.executable, "-c", "\n".join(lines)], capture_output=True, text=True, check=True).stdout
    assert "--losses.smoothness" in told
    assert told.splitlines()[-1] == "False"
