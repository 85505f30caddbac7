"""Every script of `scripts` that measures something runs with the included weights, on two small rooms and the included one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from image_sets import random_numbers, write_image_set

from semgs.cli.main import main
from semgs.rooms.sets.dataset import RoomSettings, write_dataset
from semgs.rooms.sets.demo_room import demo_scene

SCRIPTS = Path(__file__).parents[2] / "scripts"

RUNS = {
    "calibrate_mixture": (("small", "{out}.safetensors", "{rooms}", "{photos}"), "\ngaussians photos: temperature "),
    "fusion_table": (("small", "{rooms}", "1"), "| 4 | 0% |"),
    "locate_depth_errors": (("small", "{rooms}"), "| all | 100% |"),
    "more_views": (("{evaluation}",), " targets in 2 scenes"),
    "objects_and_floor": (("--rooms", "1"), "\n| truth | "),
    "pose_error": (("{room}",), "demo | 8 of 8 |"),
    "pose_noise": (
        ("small", "rooms={rooms}", "--scenes", "1", "--targets", "1", "--views", "2", "--rows", "refined"),
        " refined | ",
    ),
    "depth_maps": (("small", "{rooms}", "--bends", "0.1", "--rooms", "2"), "| 2 | inverse 10% | 0."),
    "depth_spread": (("small", "{rooms}"), " | 4 | "),
    "pose_noise_photos": (("{room}", "--seeds", "1"), "\n2 | 1 | "),
    "refine_rooms": (("{rooms}", "--passes", "1"), "\n| between | "),
    "score_regions": (("{rooms}", "small"), "small mIoU 0."),
    "smoothness_gradient": (("small", "{rooms}"), "\nequal at "),
    "sensor_depth": (("small", "{rooms}", "--rooms", "2"), "| rooms | 40% | 2 | depth_abs_rel |"),
    "teach": (("{shared}/pretrained/mosaic_ade32.tflite", "{out}", "{rooms}"), "12 images, "),
    "train_mosaic": (
        (
            "{shared}/pretrained/mosaic_ade32.safetensors",
            "{shared}/pretrained/ade32_to_scannet20.npy",
            "{out}.safetensors",
            "--photos",
            "{photos}",
            "--rooms",
            "{rooms}",
            "--steps",
            "1",
        ),
        "14 images, ",
    ),
    "up_error": ((), "degrees; "),
    "splat_labels": (("{rooms}/scene_00000", "{reconstruction}"), "photos say the classes of"),
    "walks": (("{room}", "--every", "3"), ", 8 frames | merged |"),
}
"""Arguments of each script, and a part of what it prints. `attack_app`, `average_weights`, `large_splat`, `refit_shapes` and `undo_class_weights` have tests of
their own, `shared` is for the others."""


def test_every_script_is_run_here() -> None:
    assert {path.stem for path in SCRIPTS.glob("*.py")} == {
        *RUNS,
        "attack_app",
        "average_weights",
        "shared",
        "large_splat",
        "refit_shapes",
        "undo_class_weights",
    }


@pytest.fixture(scope="module")
def rooms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scripts") / "rooms"
    write_dataset(folder, RoomSettings(77, (240, 320), 6), 2)
    return folder


@pytest.fixture(scope="module")
def evaluation(rooms: Path) -> Path:
    out = rooms.parent / "evaluation"
    options = ["--protocol", "neighbours", "--views", "2", "3", "--out", str(out)]
    assert main(["evaluate", "small", "--data", str(rooms), *options]) == 0
    return out


@pytest.fixture(scope="module")
def reconstruction(rooms: Path) -> Path:
    out = rooms.parent / "reconstruction"
    assert main(["reconstruct", str(rooms / "scene_00000"), "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def photos(rooms: Path) -> Path:
    images = {f"{k}": random_numbers(k, (96, 128)) for k in range(2)}
    return write_image_set(rooms.parent / "photos", images)


@pytest.mark.long
@pytest.mark.parametrize("name", RUNS)
def test_it_runs_with_the_included_weights(
    name: str, rooms: Path, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    arguments, said = RUNS[name]
    if name == "teach":
        pytest.importorskip("ai_edge_litert")
    places = {"rooms": rooms, "room": demo_scene(), "out": tmp_path / "out"}
    for fixture in ("evaluation", "photos", "reconstruction", "shared"):
        if any(f"{{{fixture}}}" in one for one in arguments):
            places[fixture] = request.getfixturevalue(fixture)
    command = [sys.executable, str(SCRIPTS / f"{name}.py"), *[one.format(**places) for one in arguments]]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=600)
    assert run.returncode == 0, run.stderr
    assert said in run.stdout
