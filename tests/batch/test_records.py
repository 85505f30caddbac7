"""Records of a batch: what is done, and what killed processes left."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from semgs.batch.records import (
    FOLDER,
    PICTURES,
    Record,
    is_done,
    read_record,
    remove_leftovers,
    write_failures,
    write_record,
)
from semgs.batch.tasks import Task
from semgs.files.errors import InputError
from semgs.run.export import Export

EXPORT = Export(scene=Path("scans/hall"), out=Path("hall"))


@pytest.fixture
def task(tmp_path: Path) -> Task:
    (tmp_path / FOLDER).mkdir()
    (tmp_path / PICTURES).mkdir()
    return Task("hall", Path("scans/hall"), tmp_path, "hall", "export", EXPORT, "a")


def test_a_task_is_done_if_its_record_fits_and_its_result_is_there(task: Task):
    assert not is_done(task, False)
    write_record(task.out, Record("hall", "a", 0, scores={"psnr": 21.5}, notes=("dark",)))
    assert not is_done(task, False)
    (task.out / "hall").mkdir()
    assert is_done(task, True)
    assert not is_done(replace(task, fingerprint="b"), False)
    assert read_record(task.out, "hall") == Record("hall", "a", 0, "", 0.0, {"psnr": 21.5}, ("dark",))


def test_a_failure_is_done_unless_failures_are_tried_again(task: Task):
    write_record(task.out, Record("hall", "a", 2, "no photos"))
    assert is_done(task, False)
    assert not is_done(task, True)


def test_failures_are_a_line_each_and_no_file_without_any(task: Task):
    write_failures(task.out, [Record("hall", "a", 2, "no photos"), Record("attic", "b", 3)])
    text = (task.out / "failures.jsonl").read_text()
    assert text == '{"scene": "hall", "code": 2, "error": "no photos"}\n'
    write_failures(task.out, [])
    assert not (task.out / "failures.jsonl").exists()


def test_a_damaged_record_is_named(task: Task):
    (task.out / FOLDER / "hall.json").write_text('{"name": "hall"}')
    with pytest.raises(InputError, match=r"hall.json.*delete it to repeat the scene"):
        is_done(task, False)


def test_leftovers_of_the_named_scenes_go_and_those_of_others_stay(task: Task):
    ours = (
        ".hall.0123abcd.part",
        ".hall.html.0123abcd.part",
        "records/.hall.json.0123abcd.part",
        "pictures/.hall.jpg.0123abcd.part",
    )
    shared = (
        ".index.html.0123abcd.part",
        ".index.csv.0123abcd.part",
        ".failures.jsonl.0123abcd.part",
        ".batch.json.0123abcd.part",
    )
    others = (*shared, ".hall.2.0123abcd.part", ".attic.0123abcd.part", ".hall.part", "records/.lock")
    for name in (*ours, *others):
        (task.out / name).touch()
    (task.out / ".hall.89abcdef.old" / "renders").mkdir(parents=True)
    remove_leftovers(task.out, ["hall"], shared=True)
    left = {str(path.relative_to(task.out)) for path in task.out.rglob("*") if path.is_file()}
    assert left == set(others)
    assert not (task.out / ".hall.89abcdef.old").exists()
    remove_leftovers(task.out, ["hall"])
    assert not any((task.out / name).exists() for name in shared)
