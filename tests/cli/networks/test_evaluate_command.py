"""`semgs evaluate` and `semgs compare` as they are typed."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from image_sets import random_numbers, write_image_set

from semgs.cli.main import main
from semgs.data.tables.classes import ClassTable
from semgs.files.images.pictures import read_uint8, write_png
from semgs.model import networks
from semgs.model.build import build
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import save

SIZE = (48, 64)
Refused = Callable[..., str]


def labelled(scene: Path) -> Path:
    """Give a scene labels and depths."""
    file = json.loads((scene / "transforms.json").read_text())
    rng = np.random.default_rng(0)
    for folder in ("labels", "depth"):
        (scene / folder).mkdir()
    for index, frame in enumerate(file["frames"]):
        labels = np.kron(rng.integers(0, 5, (6, 8)), np.ones((8, 8), int)).astype(np.uint8)
        write_png(scene / f"labels/{index:03d}.png", labels)
        write_png(scene / f"depth/{index:03d}.png", np.full(SIZE, 1900 + 100 * index, np.uint16))
        frame |= {"label_file_path": f"labels/{index:03d}.png", "depth_file_path": f"depth/{index:03d}.png"}
    (scene / "transforms.json").write_text(json.dumps(file | {"label_set": "scannet20"}))
    return scene


@pytest.fixture(scope="module")
def done(room: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder with scenes/room, weights and an evaluation in out, and what it said; not to be changed."""
    folder = tmp_path_factory.mktemp("evaluated")
    shutil.copytree(room, folder / "scenes/room")
    labelled(folder / "scenes/room")
    (folder / "scenes/no scene").mkdir()
    save(folder / "random.safetensors", load("small", "random"), {"description": "drawn at random"})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("semgs.evaluation.scoring.intervals.RESAMPLES", 100)
        code, told, errors = run(
            "evaluate", folder / "random.safetensors", "--data", folder / "scenes", "--views", "3", "2", "--size", "48x64",
            "--out", folder / "out", "--name", "noise",
        )  # fmt: skip
    assert (code, errors) == (0, "")
    return folder, told


def run(*arguments: object) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of a command line."""
    told, errors = io.StringIO(), io.StringIO()
    with redirect_stdout(told), redirect_stderr(errors):
        code = main(list(map(str, arguments)))
    return code, told.getvalue(), errors.getvalue()


def numbers(folder: Path) -> dict:
    return json.loads((folder / "report.json").read_text())


def test_all_files_appear_and_the_table_is_printed(done: tuple[Path, str]):
    folder, told = done
    out = folder / "out"
    assert {path.name for path in out.iterdir()} == {
        ".semgs", "frames.json", "index.json", "predictions", "report.html", "report.json", "truth",
    }  # fmt: skip
    report = numbers(out)
    assert [entry["views"] for entry in report["results"]] == [2, 3]
    assert [entry["samples"] for entry in report["results"]] == [2, 2]
    assert report["protocol"] == "neighbours"
    assert len(report["method"]["sha256"]) == 64
    for part in (
        "noise, 2 views",
        "oracle: nearest input view's true labels",
        "warped with true depth",
        "most frequent class",
        "mIoU/image",
    ):
        assert part in told, part
    assert f"{report['results'][0]['miou']:.3f}" in told
    assert told.rstrip().endswith(f"Open {out / 'report.html'} in a browser.")


def test_what_was_saved_can_be_scored_again_on_pinned_frames(done: tuple[Path, str], tmp_path: Path):
    folder, _ = done
    code, _, errors = run(
        "evaluate", "--predictions", folder / "out/predictions", "--data", folder / "scenes", "--protocol", "pinned",
        folder / "out/frames.json", "--out", tmp_path / "again",
    )  # fmt: skip
    assert (code, errors) == (0, "")
    first, again = numbers(folder / "out"), numbers(tmp_path / "again")
    assert again["method"]["kind"] == "predictions"
    assert again["frames"]["scenes"] == first["frames"]["scenes"]
    for before, after in zip(first["results"], again["results"], strict=True):
        for name in ("miou", "miou_per_image", "accuracy", "class_accuracy", "seconds_encode"):
            assert after[name] == before[name], name
        # Pictures were rounded to 8 bits and depths to millimetres.
        assert after["psnr"] == pytest.approx(before["psnr"], abs=0.02)
        assert after["depth_abs_rel"] == pytest.approx(before["depth_abs_rel"], abs=1e-3)
    assert not (tmp_path / "again/predictions").exists()


@pytest.mark.parametrize("form", ["text", "markdown", "latex"])
def test_compare_puts_the_papers_rows_above_ours_and_never_in_bold(done: tuple[Path, str], form: str):
    report = done[0] / "out/report.json"
    code, told, errors = run("compare", report, report, "--published", "scannet", "--format", form)
    assert (code, errors) == (0, "")
    mark = r"$^\ddagger$" if form == "latex" else "‡"
    (line,) = [line for line in told.splitlines() if "SemGS" in line and "0.754" in line]
    assert f"SemGS {mark}" in line
    assert "textbf" not in line
    assert "**" not in line
    assert told.index("GSNeRF") < told.index("noise")
    for part in ("published, not run here", "neither its ten test scenes", "FPS of the rows run here"):
        assert part in told, part
    code, told, _ = run("compare", report, "--published", "ablation")
    assert code == 0
    assert "Table 3" in told  # of four views, which this report has not: no number of it is shown
    assert "0.765" not in told


def test_compare_puts_reports_of_different_data_below_each_other(done: tuple[Path, str], room: Path, tmp_path: Path):
    report = done[0] / "out"
    shutil.copytree(report, tmp_path / "other")
    moved = numbers(report)
    moved["data"]["path"] = "somewhere/house"
    moved["data"]["scenes"] *= 2
    moved["results"][0]["per_frame"][0]["target"] = "images/009.png"
    (tmp_path / "other/report.json").write_text(json.dumps(moved))
    code, told, errors = run("compare", report, tmp_path / "other", "--layout", "data")
    assert (code, errors) == (0, "")
    lines = [line.split("  ")[0].strip() for line in told.splitlines()]
    plain = [re.sub(r"^noise [0-9a-f]{8} on", "noise on", line) for line in lines]
    assert "noise on room (1 scene), 2 views" in plain
    assert "noise on house (1 scene), 3 views" in plain
    assert "noise on room (1 scene), 2 views" not in lines, "each row names its weights by their hash"
    assert told.count("oracle: nearest input view's true labels") >= 4
    assert "not comparable with each other" in told


def test_scenes_of_a_list_are_evaluated_with_the_near_and_far_that_are_given(done: tuple[Path, str], tmp_path: Path):
    folder, _ = done
    (tmp_path / "list.txt").write_text("room\n")
    shutil.copytree(folder / "scenes/room", tmp_path / "scenes/room")
    shutil.copytree(folder / "scenes/room", tmp_path / "scenes/other")
    code, _, errors = run(
        "evaluate", folder / "random.safetensors", "--data", tmp_path / "scenes", "--scenes", tmp_path / "list.txt",
        "--views", "2", "--size", "48x64", "--depth-range", "0.1", "10", "--out", tmp_path / "out",
    )  # fmt: skip
    assert (code, errors) == (0, "")
    first, report = numbers(folder / "out"), numbers(tmp_path / "out")
    assert [scene["name"] for scene in report["data"]["scenes"]] == ["room"]
    assert report["protocol"] == "neighbours, near 0.1 and far 10"
    assert report["results"][0]["truth_sha256"] == first["results"][0]["truth_sha256"]
    assert report["results"][0]["psnr"] != first["results"][0]["psnr"]


def test_rooms_that_the_weights_were_trained_in_are_refused_or_told_of(done: tuple[Path, str], tmp_path: Path):
    folder, _ = done
    shutil.copytree(folder / "scenes/room", tmp_path / "scenes/scene0007_01")
    save(tmp_path / "seen.safetensors", load("small", "random"), {"scenes": '["scene0007_00"]'})
    command = (
        "evaluate", tmp_path / "seen.safetensors", "--data", tmp_path / "scenes", "--views", "2", "--size", "48x64",
        "--out", tmp_path / "out",
    )  # fmt: skip
    code, _, errors = run(*command)
    assert code == 2
    assert errors.count("\n") == 1
    assert "found 1 that were: scene0007_01 (as scene0007_00)" in errors
    assert not (tmp_path / "out").exists()
    code, told, _ = run(*command, "--allow-seen")
    assert code == 0
    assert "The weights were trained on rooms that are scored here: scene0007_01." in told


def test_predictions_that_are_the_truth_score_exactly_one_and_pixels_without_one_do_not_count(
    done: tuple[Path, str], tmp_path: Path
):
    folder, _ = done
    shutil.copytree(folder / "out/truth", tmp_path / "theirs/N2")
    labels = read_uint8(tmp_path / "theirs/N2/room/001.png")
    labels[:10] = 255
    write_png(tmp_path / "theirs/N2/room/001.png", labels)
    code, told, _ = run(
        "evaluate", "--predictions", tmp_path / "theirs", "--data", folder / "scenes/room", "--size", "48x64", "--out",
        tmp_path / "out",
    )  # fmt: skip
    assert code == 0
    (result,) = numbers(tmp_path / "out")["results"]
    assert [result[name] for name in ("miou", "miou_per_image", "accuracy", "class_accuracy_per_image")] == [1.0] * 4
    assert result["not_given"] == pytest.approx(10 * 64 / (2 * 48 * 64))
    assert "not given" in told


@pytest.mark.parametrize("form", ["text", "markdown", "latex"])
def test_compare_prints_the_papers_columns(done: tuple[Path, str], form: str):
    folder, _ = done
    code, told, errors = run("compare", folder / "out/report.json", "--format", form)
    assert (code, errors) == (0, "")
    value = numbers(folder / "out")["results"][1]["miou_per_image"]
    for part in (
        "noise",
        "2 input views",
        "3 input views",
        "mIoU",
        "class acc.",
        "FPS",
        f"{value:.3f}",
        "most frequent class",
    ):
        assert part in told, part


def test_compare_prints_differences(done: tuple[Path, str]):
    folder, _ = done
    report = folder / "out"
    code, told, _ = run("compare", report, report / "report.json", "--layout", "difference")
    assert code == 0
    assert re.search(r"noise ([0-9a-f]{8}) #2 minus noise \1 #1", told)
    assert "paired bootstrap over frames (fewer than five scenes)" in told
    assert "0.000 to 0.000" in told


def test_compare_adds_metrics_of_groups_and_says_which_weights_are_included(done: tuple[Path, str]):
    report = done[0] / "out"
    code, told, _ = run("compare", report, "--merge", "coarse13")
    assert code == 0
    assert "mIoU (merged)" in told
    assert "Merged: by groups of classes (13 groups)." in told
    assert re.search(r"Weights, by the beginning of their SHA-256: [0-9a-f]{8} is not included\.", told)
    code, _, errors = run("compare", report, "--merge", "finer")
    assert code == 2
    assert "finer: expected groups of classes: alike or coarse13, or a file" in errors


@pytest.fixture
def refused(done: tuple[Path, str], tmp_path: Path) -> Refused:
    """Runs `semgs evaluate` on the scenes, checks that it is refused on one line, and returns the line."""

    def refuse(*options: object, data: Path | None = None, out: Path | None = None) -> str:
        arguments = ["evaluate", *options, "--data", data or done[0] / "scenes", "--out", out or tmp_path / "never"]
        code, told, errors = run(*arguments)
        assert (code, told) == (2, "")
        assert errors.startswith("semgs: error: ")
        assert errors.count("\n") == 1
        assert not (tmp_path / "never").exists()
        assert not list(tmp_path.glob(".*.part"))
        return errors

    return refuse


def test_neither_or_both_of_weights_and_predictions(refused: Refused, tmp_path: Path):
    assert "expected either WEIGHTS or --predictions" in refused()
    assert "expected either" in refused("small", "--predictions", tmp_path)
    code, _, errors = run("evaluate", "small", "--out", tmp_path / "never")
    assert code == 2
    assert "--data" in errors


def test_options_of_a_network_are_not_for_predictions(refused: Refused, tmp_path: Path):
    """Near and far would be in the report's protocol, and have no effect."""
    for option in (
        "--nearest 2",
        "--refine",
        "--exposure auto",
        "--depth-range 0.1 10",
        "--precision auto",
        "--allow-seen",
    ):
        name, *values = option.split()
        assert f"{name} cannot go with --predictions" in refused("--predictions", tmp_path, name, *values)
    assert "--nearest" in refused("small", "--nearest", "0")


def test_an_unknown_protocol_lists_the_known(refused: Refused):
    line = refused("small", "--protocol", "neighbors")
    assert "expected one of neighbours, peers, pairs, aside, lsm [FILE], pinned FILE, found 'neighbors'" in line
    assert "expected a FILE after pinned" in refused("small", "--protocol", "pinned")
    assert "expected one of" in refused("small", "--protocol", "peers", "7")
    assert "no such file" in refused("small", "--protocol", "pinned", "nowhere.json")
    assert "--gsnerf-distance is for --protocol peers" in refused("small", "--gsnerf-distance")


def test_readings_as_peers_are_known_ones_of_the_layout(refused: Refused):
    assert "unknown reading 'gsnerf'; known: rows-972, gsnerf-labels" in refused("small", "--as-peers", "gsnerf")
    line = refused("small", "--as-peers", "gsnerf-labels", "rows-972")
    assert "expected a scene for the reading gsnerf-labels" in line
    assert "found transforms.json" in line


def test_a_sensor_that_measured_nothing(refused: Refused, room: Path, tmp_path: Path):
    scene = labelled(shutil.copytree(room, tmp_path / "room"))
    file = json.loads((scene / "transforms.json").read_text())
    del file["frames"][1]["depth_file_path"]
    (scene / "transforms.json").write_text(json.dumps(file))
    line = refused("small", "--depth", "sensor", "--views", "2", data=scene)
    assert "expected measured depth of each input view for --depth sensor, found none" in line
    assert "--depth-meaning is for --depth SOURCE" in refused("small", "--depth", "sensor", "--depth-meaning", "metric")


def test_near_and_far_that_cannot_be(refused: Refused):
    line = refused("small", "--depth-range", "2", "1")
    assert "--depth-range: expected near and far, 0 < near < far, found '2 1'" in line
    assert "expected a text file of scenes, or one of" in refused("small", "--scenes", "scannet-sray")


def test_more_views_than_the_scene_has(refused: Refused):
    assert "expected at least 4 frames to render a target from, found 3" in refused("small", "--views", "2", "4")
    assert "--views: expected a whole number, 2 or more" in refused("small", "--views", "1")


def test_no_data(refused: Refused, tmp_path: Path):
    (tmp_path / "empty").mkdir()
    assert "a scene or a folder of scenes" in refused("small", data=tmp_path / "empty")
    assert "nothing there" in refused("small", data=tmp_path / "nowhere")


def test_weights_that_cannot_be_used(refused: Refused, done: tuple[Path, str], tmp_path: Path):
    assert "expected a file of weights, or small" in refused("smal")
    assert 'no included weights for "base"' in refused("base", "--views", "2")
    table = ClassTable("two", ("a", "b"), ((1, 2, 3), (4, 5, 6)), (1, 2))
    save(tmp_path / "two.safetensors", build(networks.small(), table), {})
    line = refused(tmp_path / "two.safetensors", "--views", "2")
    assert "expected class table scannet20 (20 classes), found two (2 classes)" in line
    whole = (done[0] / "random.safetensors").read_bytes()
    (tmp_path / "cut.safetensors").write_bytes(whole[: len(whole) // 2])
    assert "cut.safetensors" in refused(tmp_path / "cut.safetensors", "--views", "2")


def test_predictions_that_are_missing_or_of_another_size_name_their_frames(
    refused: Refused, done: tuple[Path, str], tmp_path: Path
):
    folder, _ = done
    theirs = tmp_path / "theirs"
    assert "nothing there" in refused("--predictions", theirs)
    shutil.copytree(folder / "out/truth", theirs / "N2")
    assert "N2/room/001.png (48x64)" in refused("--predictions", theirs)
    (theirs / "N2/room/002.png").unlink()
    line = refused("--predictions", theirs, "--size", "48x64")
    assert "labels of all 2 targets of 2 views, found none of N2/room/002.png" in line
    assert "N3/room/001.png, N3/room/002.png" in refused("--predictions", theirs, "--views", "3")


def test_a_predicted_label_outside_the_table_names_its_frame(refused: Refused, done: tuple[Path, str], tmp_path: Path):
    shutil.copytree(done[0] / "out/truth", tmp_path / "theirs/N2")
    labels = read_uint8(tmp_path / "theirs/N2/room/001.png")
    labels[5, 5] = 41
    write_png(tmp_path / "theirs/N2/room/001.png", labels)
    line = refused("--predictions", tmp_path / "theirs", "--size", "48x64")
    assert "target images/001.png of room: expected labels 0..19 of table scannet20" in line


def test_an_output_folder_of_somebody_else(refused: Refused, tmp_path: Path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos/a.txt").write_text("mine")
    assert "mark .semgs" in refused("small", "--overwrite", out=tmp_path / "photos")


def test_scenes_without_labels_are_scored_by_colour_and_it_is_said(room: Path, done: tuple[Path, str], tmp_path: Path):
    weights = done[0] / "random.safetensors"
    code, told, _ = run(
        "evaluate", weights, "--data", room, "--views", "2", "--size", "48x64", "--out", tmp_path / "out"
    )
    assert code == 0
    assert "No labels in room: only metrics of colour and depth use these scenes." in told
    (result,) = numbers(tmp_path / "out")["results"]
    assert (result["miou"], result["per_class"], result["depth_abs_rel"]) == (None, [], None)
    assert result["psnr"] > 0


def test_reports_that_cannot_be_compared(done: tuple[Path, str], tmp_path: Path):
    report = done[0] / "out/report.json"
    (tmp_path / "other.json").write_text('{"format": "semgs.report.reconstruct"}')
    broken = numbers(done[0] / "out")
    del broken["results"][0]["per_frame"][0]["target"]
    (tmp_path / "broken.json").write_text(json.dumps(broken))
    worded = numbers(done[0] / "out")
    worded["results"][1]["trivial"]["copy"]["miou"] = "good"
    (tmp_path / "worded.json").write_text(json.dumps(worded))
    moved = numbers(done[0] / "out")
    moved["results"][0]["per_frame"][0]["contexts"].reverse()
    (tmp_path / "moved.json").write_text(json.dumps(moved))
    for arguments, told in (
        ((), "semgs compare needs REPORT.json; see semgs compare --help"),
        ((tmp_path / "nowhere.json",), "nothing there"),
        ((tmp_path / "other.json",), "expected a report of format semgs.report.evaluate"),
        ((tmp_path / "broken.json",), "KeyError: 'target'"),
        ((tmp_path / "worded.json",), "'good' is not a number"),
        ((report, tmp_path / "moved.json"), "contexts images/002.png, images/000.png of room/images/001.png"),
        ((report, "--layout", "difference"), "needs two or more reports"),
        ((report, "--layout", "sideways"), "sideways"),
        ((report, "--layout", "data", "--published", "scannet"), "--published is for --layout paper"),
    ):
        code, out, errors = run("compare", *arguments)
        assert (code, out) == (2, "")
        assert told in errors
        assert errors.count("\n") == 1


def test_single_images_are_scored_without_cameras(done: tuple[Path, str], tmp_path: Path):
    folder, _ = done
    photos = write_image_set(tmp_path / "photos", {f"{k}": random_numbers(k, (32, 48)) for k in range(2)})
    arguments = ("--single", "--size", "48x64", "--name", "noise")
    for data, images, label in ((photos, 2, "photos"), (folder / "scenes", 4, "room")):
        code, told, errors = run(
            "evaluate", folder / "random.safetensors", "--data", data, "--out", tmp_path / f"of {label}", *arguments
        )
        assert (code, errors) == (0, "")
        report = numbers(tmp_path / f"of {label}")
        assert (report["format"], report["images"]) == ("semgs.report.single", images)
        assert f"{images} images" in told
        assert f"{report['miou']:.3f}" in told
        assert len(list((tmp_path / f"of {label}" / "predictions" / label).iterdir())) == images


def test_two_looks_are_counted_and_told(done: tuple[Path, str], refused: Refused, tmp_path: Path):
    photos = write_image_set(tmp_path / "photos", {"a": random_numbers(0, (32, 48))})
    arguments = ("--single", "--size", "48x64", "--data", photos)
    said = {}
    for looks in (1, 2):
        code, said[looks], errors = run(
            "evaluate", done[0] / "random.safetensors", "--out", tmp_path / f"of {looks}", "--looks", looks, *arguments
        )
        assert (code, errors) == (0, "")
    note = "The network looked at each view twice to classify it (--looks 2)."
    assert (note in said[1], note in said[2]) == (False, True)
    assert numbers(tmp_path / "of 1")["ece"] != numbers(tmp_path / "of 2")["ece"]
    assert "looks is 2; expected 1" in refused("small_plain", "--looks", "2", "--views", "2")
    assert "--looks: expected one of 1, 2, found '3'" in refused("small", "--looks", "3")


def test_weights_without_classes_cannot_score_single_images(refused: Refused, tmp_path: Path, monkeypatch):
    photos = write_image_set(tmp_path / "photos", {"a": random_numbers(0, (32, 48))})
    monkeypatch.setattr("semgs.evaluation.run.open_network", lambda *given: (SimpleNamespace(classes=None), None))
    assert "expected weights with classes, found weights for colour and depth" in refused(
        "small", "--single", data=photos
    )


def test_options_for_several_views_cannot_go_with_single(refused: Refused, tmp_path: Path):
    photos = write_image_set(tmp_path / "photos", {"a": random_numbers(0, (32, 48))})
    told = refused("small", "--single", "--views", "2", "--workers", "2", data=photos)
    assert "--views cannot go with --single" in told
    assert "images with cameras, found labelled images" in refused("small", data=photos)
