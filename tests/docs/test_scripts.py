"""Every script of `scripts` that measures something runs with the included weights, on two small rooms and the included one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from image_sets import random_numbers, write_image_set

from semgs_rooms.sets.dataset import RoomSettings, write_dataset

SCRIPTS = Path(__file__).parents[2] / "scripts"

RUNS = {
    "calibrate_mixture": (("small", "{out}.safetensors", "{rooms}", "{photos}"), "\ngaussians photos: temperature "),
    "depth_maps": (("small", "{rooms}", "--bends", "0.1", "--rooms", "2"), "| 2 | inverse 10% | 0."),
    "depth_spread": (("small", "{rooms}"), " | 4 | "),
    "heights_of_things": (("{rooms}", "--out", "{out}.json"), "limits for "),
    "mesh_error": (("small", "{rooms}", "--frames", "2", "--rooms", "1"), "\n| true | true | 0."),
    "ids_over_time": (("small", "{rooms}"), "\n| one map | Gaussians and voxels | "),
    "teach": (("{shared}/pretrained/mosaic_ade32.tflite", "{out}", "{rooms}"), "12 images, "),
    "things_oracles": (("small", "{rooms}", "--every", "4"), "\n| own | own | join 0.8 | "),
    "train_class_backbone": (
        ("{out}.safetensors", "--photos", "{photos}", "--rooms", "{rooms}", "--steps", "1"),
        "14 images, ",
    ),
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
}
"""Arguments of each script, and a part of what it prints. `attack_app`, `average_weights`, `index_page`, `large_splat` and `undo_class_weights` have tests of their own."""


def test_every_script_is_run_here() -> None:
    assert {path.stem for path in SCRIPTS.glob("*.py")} == {
        *RUNS,
        "attack_app",
        "average_weights",
        "index_page",
        "large_splat",
        "undo_class_weights",
    }


@pytest.fixture(scope="module")
def rooms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scripts") / "rooms"
    write_dataset(folder, RoomSettings(77, (240, 320), 6), 2)
    return folder


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
    places = {"rooms": rooms, "out": tmp_path / "out"}
    for fixture in ("photos", "shared"):
        if any(f"{{{fixture}}}" in one for one in arguments):
            places[fixture] = request.getfixturevalue(fixture)
    command = [sys.executable, str(SCRIPTS / f"{name}.py"), *[one.format(**places) for one in arguments]]
    run = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=600)
    assert run.returncode == 0, run.stderr
    assert said in run.stdout
