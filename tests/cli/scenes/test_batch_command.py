"""`semgs batch`: many scenes, some of them broken."""

from __future__ import annotations

import json
import shutil
import signal
import time
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from random import Random

import pytest
from batch_kills import kill_worker, start, tree, wait_for_end, workers_of
from saved_scenes import wall

import semgs.runtime.workers
from semgs.cli.commands.scenes.batch import Batch
from semgs.cli.main import main
from semgs.data.demo_scene import demo_scene
from semgs.files.atomic import write_json
from semgs.run.usage_errors import UsageError
from semgs.scene.scene_file import save_scene

TWO_WORKERS = ("--workers", "2")


def save_walls(folder: Path, count: int) -> None:
    """Reconstructed scenes."""
    for k in range(count):
        (folder / f"wall_{k}").mkdir(parents=True)
        save_scene(folder / f"wall_{k}" / "scene.safetensors", wall(origin=float(k)))


@pytest.fixture
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes are worked on one after another, without workers."""

    def one_by_one(work: Callable, tasks: Sequence, workers: int, begin: Callable) -> Generator:
        yield from enumerate(map(work, tasks))

    monkeypatch.setattr(semgs.runtime.workers, "finished", one_by_one)


def test_options_are_those_of_the_batch_or_of_its_command():
    words = [
        "reconstruct",
        "a",
        "b",
        "--views",
        "3",
        "--out=o",
        "--all",
        "--workers",
        "2",
        "--context",
        "1",
        "2",
        "--retry-failed",
    ]
    assert Batch.split(words) == (
        ["reconstruct", "a", "b", "--out=o", "--workers", "2", "--retry-failed"],
        ["--views", "3", "--all", "--context", "1", "2"],
    )
    with pytest.raises(UsageError, match="--out is given twice"):
        Batch.split(["reconstruct", "a", "--out", "x", "--out=y"])


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ("export --out {tmp}/o", "semgs batch needs DATA; see semgs batch --help"),
        ("export {tmp}/nowhere --out {tmp}/o", "nowhere: expected input of semgs export, found nothing there"),
        ("export {tmp}/*.none --out {tmp}/o", "expected input of semgs export, found nothing there"),
        ("reconstruct {tmp}/nowhere --out {tmp}/o", "nowhere: expected a folder with a scene, found nothing there"),
        ("reconstruct {tmp}/scans --out {tmp}/o", "scans: expected a scene or a folder of scenes"),
        ("reconstruct {tmp}/scans --out {tmp}/o --scenes {tmp}/nolist", "nolist: expected a text file of scenes"),
        ("export {tmp}/scans --out {tmp}/file", "file: expected a new or empty folder, or the results of a batch"),
        ("export {tmp}/scans --out {tmp}/scans", "--out is in {tmp}/scans, which is searched for scenes"),
        ("export {tmp}/scans --out {tmp}/scans/wall_0/o", "--out is in the scene"),
        ("export {tmp}/scans --out {tmp}/scans/o", "scans, which is searched for scenes; name a folder elsewhere"),
        ("reconstruct {tmp}/room/transforms.json --out {tmp}/room/o", "--out is in the scene"),
        ("export {tmp}/scans --out {tmp}/o --out {tmp}/p", "--out is given twice"),
        ("export {tmp}/scans --out {tmp}/o --shard 3/2", "--shard: expected I/N, such as 1/8, found '3/2'"),
        ("export {tmp}/scans --out {tmp}/o --workers 0", "--workers: expected a whole number, 1 or more, found '0'"),
        ("export {tmp}/scans --out {tmp}/o --ass ply", "there is no option --ass; did you mean --as?"),
        ("export {tmp}/scans --out {tmp}/o --overwrite", "--overwrite is not for semgs batch"),
        ("export {tmp}/scans --out {tmp}/o --ray auto --workers 2", "--workers cannot go with --ray"),
        ("export {tmp}/records --out {tmp}/o", "would be named records"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_and_nothing_is_written(
    arguments: str, line: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 1)
    (tmp_path / "file").touch()
    shutil.copytree(demo_scene(), tmp_path / "room")
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "scene.safetensors").touch()
    before = tree(tmp_path)
    assert main(["batch", *arguments.format(tmp=tmp_path).split()]) == 2
    told = capsys.readouterr()
    assert told.err.startswith("semgs: error: ")
    assert line.format(tmp=tmp_path) in told.err.splitlines()[0]
    assert told.err.count("\n") == 1
    assert tree(tmp_path) == before


def test_a_name_with_brackets_is_that_folder_and_not_a_pattern_for_another(tmp_path: Path, in_this_process: None):
    save_walls(tmp_path, 3)
    scan, other = tmp_path / "scan[1]", tmp_path / "scan1"
    (tmp_path / "wall_1").rename(scan)
    (tmp_path / "wall_2").rename(other)
    command = ["batch", "export", "--out", str(tmp_path / "out"), *TWO_WORKERS, "--as", "points"]
    assert main([*command[:2], str(scan), *command[2:]]) == 0
    assert (tmp_path / "out" / "scan[1]" / "points.ply").is_file()
    assert not (tmp_path / "out" / "scan1").exists()
    assert (
        main([*command[:2], str(tmp_path / "scan[0-9]"), *command[2:]]) == 0
    )  # no folder has this name, so it is a pattern
    assert (tmp_path / "out" / "scan1" / "points.ply").is_file()


def test_names_that_look_like_options_or_home_folders_are_names(
    tmp_path: Path, in_this_process: None, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    names = ["-dash", "--out", "~", "new\nline", "Ku\u0308che", "e" * 235]
    save_walls(tmp_path, len(names))
    (tmp_path / "scans").mkdir()
    for k, name in enumerate(names):
        (tmp_path / f"wall_{k}").rename(tmp_path / "scans" / name)
    monkeypatch.chdir(tmp_path / "scans")
    assert main(["batch", "export", ".", "--out", "../out", *TWO_WORKERS, "--as", "points"]) == 0
    assert "6 of 6 scenes succeeded" in capsys.readouterr().out
    for name in names:
        assert (tmp_path / "out" / name / "points.ply").is_file()
    assert main(["batch", "export", "./-dash", "--out", "../one", *TWO_WORKERS, "--as", "points"]) == 0
    told = capsys.readouterr().out
    assert "0 of 1 scenes are done" in told
    assert "1 of 1 scenes succeeded" in told
    assert main(["batch", "export", "./-dash", "--out", "../one", *TWO_WORKERS, "--as", "ply"]) == 0
    assert "1 scene was done with other options or other files; the results are replaced" in capsys.readouterr().out


def test_a_name_that_leaves_no_room_for_temporary_names_is_refused_before_any_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 2)
    (tmp_path / "scans" / "wall_0").rename(tmp_path / "scans" / ("\u00fc" * 118))
    assert main(["batch", "export", str(tmp_path / "scans"), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr()
    assert told.err.endswith("has a name of 236 bytes; at most 235 fit, so rename the scene\n")
    assert not (tmp_path / "out").exists()


def test_what_is_in_the_way_of_a_batch_is_one_line(
    tmp_path: Path, in_this_process: None, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 1)
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "gone").symlink_to("nowhere")
    command = ["batch", "export", str(tmp_path / "scans"), *TWO_WORKERS, "--as", "points", "--out"]

    def refused(out: Path) -> str:
        capsys.readouterr()
        assert main([*command, str(out)]) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        return line

    assert "loop: expected something that can be read, found a link that leads to itself" in refused(tmp_path / "loop")
    assert "found a broken link" in refused(tmp_path / "gone")
    out = tmp_path / "out"
    assert main([*command, str(out)]) == 0
    (out / "records" / "wall_0.json").unlink()
    (out / "records" / "wall_0.json").mkdir()
    assert "wall_0.json: expected the record of a scene, found a folder" in refused(out)
    shutil.rmtree(out / "pictures")
    (out / "pictures").touch()
    assert "pictures: expected a folder, found a file; move it away" in refused(out)
    assert (out / "wall_0" / "points.ply").is_file()


def test_a_list_chooses_among_all_inputs_of_every_command(
    tmp_path: Path, in_this_process: None, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 3)
    save_walls(tmp_path / "more", 1)
    (tmp_path / "more" / "wall_0").rename(tmp_path / "more" / "hall")
    (tmp_path / "list").write_text("# two of four\n\nwall_1\nhall\n")
    data = [str(tmp_path / "scans"), str(tmp_path / "more")]
    rest = ["--out", str(tmp_path / "out"), *TWO_WORKERS, "--as", "points", "--scenes", str(tmp_path / "list")]
    assert main(["batch", "export", *data, *rest]) == 0
    assert "2 of 2 scenes succeeded" in capsys.readouterr().out
    assert {path.parent.name for path in (tmp_path / "out").glob("*/points.ply")} == {"wall_1", "hall"}
    assert main(["batch", "export", data[0], *rest]) == 2
    assert "expected names of scenes in" in (line := capsys.readouterr().err)
    assert "found hall, which is missing" in line


def test_a_folder_without_a_reconstruction_among_others_fails_and_what_a_batch_wrote_beside_its_results_is_skipped(
    tmp_path: Path, in_this_process: None, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 1)
    (tmp_path / "scans" / "empty").mkdir()
    write_json(tmp_path / "scans" / "batch.json", {"command": "reconstruct"})
    (tmp_path / "scans" / "records").mkdir()
    (tmp_path / "scans" / "index.html").touch()
    options = ["--out", str(tmp_path / "out"), *TWO_WORKERS, "--as", "points"]
    assert main(["batch", "export", str(tmp_path / "scans" / "*"), *options]) == 3
    told = capsys.readouterr().out
    assert f"empty: {tmp_path / 'scans' / 'empty'}" in told
    assert "1 of 2 scenes succeeded" in told


def test_a_scene_that_its_result_would_replace_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    save_walls(tmp_path / "scans", 1)
    write_json(tmp_path / "scans" / "batch.json", {"command": "export"})
    before = tree(tmp_path)
    assert main(["batch", "export", str(tmp_path / "scans/wall_0"), "--out", str(tmp_path / "scans")]) == 2
    assert "scans/wall_0: expected an output apart from the input, found the input itself" in capsys.readouterr().err
    assert tree(tmp_path) == before


def test_bad_scenes_are_recorded_and_the_rest_is_done_and_a_repeated_call_does_what_is_left(
    tmp_path: Path, in_this_process: None, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 2)
    broken, out = tmp_path / "scans" / "broken" / "scene.safetensors", tmp_path / "out"
    broken.parent.mkdir()
    broken.write_bytes(b"no scene")
    command = ["batch", "export", str(tmp_path / "scans"), "--out", str(out), *TWO_WORKERS, "--as", "points"]
    assert main(command) == 3
    told = capsys.readouterr().out
    assert "0 of 3 scenes are done" in told
    assert f"broken: {broken}: expected" in told
    assert "2 of 3 scenes succeeded" in told
    assert [json.loads(line)["scene"] for line in (out / "failures.jsonl").read_text().splitlines()] == ["broken"]
    assert not (out / "broken").exists()
    before = (out / "wall_0" / "points.ply").stat()

    assert main(command) == 3
    told = capsys.readouterr().out
    assert "2 of 3 scenes are done" in told
    assert f"broken: {broken}: expected" in told
    assert "1 scene was skipped after failing in an earlier call; --retry-failed tries again" in told
    assert "2 of 3 scenes succeeded" in told
    save_scene(broken, wall())  # another file is another input
    assert main([*command, "--retry-failed"]) == 0
    assert "2 of 3 scenes are done" in capsys.readouterr().out
    assert not (out / "failures.jsonl").exists()
    assert (out / "wall_0" / "points.ply").stat() == before
    assert "3 done" in (out / "index.html").read_text()

    assert main(["batch", "doctor", str(tmp_path / "scans"), "--out", str(out)]) == 2
    capsys.readouterr()


def test_parts_share_a_folder_and_each_result_is_that_of_one_call(
    tmp_path: Path, in_this_process: None, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 3)
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    command = ["batch", "export", str(tmp_path / "scans"), "--workers", "1", "--out"]
    assert main([*command, str(whole)]) == 0
    assert main([*command, str(parts), "--shard", "2/2"]) == 0
    assert {path.name for path in parts.glob("wall_*")} == {"wall_1"}
    assert "1 done, 2 waiting" in (parts / "index.html").read_text()
    assert main([*command, str(parts), "--shard", "1/2"]) == 0
    capsys.readouterr()
    there, here = tree(whole), tree(parts)
    assert {name for name in here.keys() ^ there.keys() if "/.lock" not in name} == set()
    assert [name for name in there.keys() & here.keys() if there[name] != here[name]] == []


def end_of(arguments: list[str]) -> int:
    """The exit code of `semgs batch` in a process of its own."""
    run = start(arguments)
    _, errors = run.communicate(timeout=280)
    assert errors == ""
    return run.returncode


@pytest.mark.long
def test_a_killed_worker_and_a_killed_run_change_nothing(
    tmp_path: Path, in_this_process: None, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 4)
    command = ["export", str(tmp_path / "scans"), *TWO_WORKERS, "--as", "points", "--out"]
    run = start([*command, str(tmp_path / "killed")])
    until = time.monotonic() + 120
    while not kill_worker(run.pid, 0):
        assert time.monotonic() < until
    while len(workers := workers_of(run.pid)) < 2:
        assert time.monotonic() < until
    time.sleep(0.5)
    run.kill()
    run.communicate()
    wait_for_end(workers)
    assert main(["batch", *command, str(tmp_path / "killed")]) == 0
    assert main(["batch", *command, str(tmp_path / "undisturbed")]) == 0
    capsys.readouterr()
    assert tree(tmp_path / "killed") == tree(tmp_path / "undisturbed")


def check_kills(command: list[str], folder: Path, kills: int, seed: int) -> None:
    """Kill a run or a worker at random times, in turns; afterwards the same command gives the result of an undisturbed run."""
    begin = time.monotonic()
    assert end_of([*command, "--out", str(folder / "undisturbed")]) == 0
    seconds = time.monotonic() - begin
    expected = tree(folder / "undisturbed")
    random = Random(seed)
    for kill in range(kills):
        out = folder / str(kill)
        run = start([*command, "--out", str(out)])
        time.sleep(random.uniform(0.1, 1) * seconds)
        if kill % 2:
            kill_worker(run.pid, kill // 2)
        else:
            workers = workers_of(run.pid)
            run.send_signal(signal.SIGKILL)
            wait_for_end(workers)
        run.communicate(timeout=280)
        assert end_of([*command, "--out", str(out)]) == 0
        found = tree(out)
        assert found.keys() == expected.keys(), kill
        assert [name for name in expected if expected[name] != found[name]] == [], kill


@pytest.mark.long
@pytest.mark.timeout(3000)
def test_ten_killed_runs_and_ten_killed_workers_change_nothing(tmp_path: Path):
    save_walls(tmp_path / "scans", 30)
    check_kills(["export", str(tmp_path / "scans"), *TWO_WORKERS, "--as", "points", "ply"], tmp_path / "export", 12, 2)
    assert (
        main(["rooms", str(tmp_path / "rooms"), "--scenes", "6", "--size", "48x64", "--frames", "4", "--workers", "0"])
        == 0
    )
    check_kills(["reconstruct", str(tmp_path / "rooms"), *TWO_WORKERS], tmp_path / "reconstruct", 8, 3)


@pytest.mark.long
@pytest.mark.timeout(3000)
def test_of_two_hundred_rooms_the_ten_broken_ones_are_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    rooms, out = tmp_path / "rooms", tmp_path / "out"
    assert main(["rooms", str(rooms), "--scenes", "200", "--size", "48x64", "--frames", "3", *TWO_WORKERS]) == 0
    broken = [f"scene_{k:05d}" for k in range(7, 200, 20)]
    for k, name in enumerate(broken):
        cameras = rooms / name / "transforms.json"
        cameras.write_text(("{}", "no JSON", cameras.read_text().replace('"frames"', '"framez"'))[k % 3])
    assert main(["batch", "reconstruct", str(rooms), "--out", str(out), *TWO_WORKERS]) == 3
    assert "190 of 200 scenes succeeded" in capsys.readouterr().out
    assert len(list(out.glob("scene_*/report.html"))) == 190
    assert len(list(out.glob("pictures/*.jpg"))) == 190
    records = [json.loads(line) for line in (out / "failures.jsonl").read_text().splitlines()]
    assert [record["scene"] for record in records] == broken
    assert all(record["code"] == 2 and "transforms.json" in record["error"] for record in records)


def test_of_a_scene_without_metres_the_formats_that_need_none_are_written(
    tmp_path: Path, in_this_process: None, capsys: pytest.CaptureFixture[str]
):
    save_walls(tmp_path / "scans", 1)
    options = ["--out", str(tmp_path / "out"), *TWO_WORKERS, "--as", "points", "occupancy"]
    code = main(["batch", "export", str(tmp_path / "scans"), *options])
    (record,) = (tmp_path / "out" / "records").glob("*.json")
    found = json.loads(record.read_text())
    assert (code, found["code"]) == (0, 3)
    assert found["why"].startswith("--as occupancy is not written: ")
    assert (tmp_path / "out" / record.stem / "points.ply").exists()
