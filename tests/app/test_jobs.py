"""The queue, with workers that only pretend: order, cancelling, errors in words, and nothing left behind."""

from __future__ import annotations

import errno
import io
import os
import shutil
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from semgs.app.jobs import BUG, KILLED, NO_WORKER, TOO_LARGE, TOO_MUCH, UPLOAD_SECONDS, Job, Jobs, _listen, _note_report
from semgs.app.limits import Limits
from semgs.app.requests import Request, RoomOptions
from semgs.app.uploads import UnusableUploadError, Upload, content_of
from semgs.runtime.free_memory import group_bytes

WORKER = """
import json, os, pathlib, sys, tempfile, time
line = sys.stdin.readline()
if not line: sys.exit()
request = json.loads(line)
def stage(title, **counts): print(json.dumps({"stage": title, **counts}), file=sys.stderr, flush=True)
folder = pathlib.Path(request["folder"])
(folder / "work").mkdir()
what = request["options"]["words"]
if what == "mute":
    time.sleep(600)
stage("Starting")
if what == "orphan":
    if os.fork(): os.kill(os.getpid(), 9)
    time.sleep(3600)
if what in ("grow", "child grows"):
    if what == "child grows" and os.fork(): os.wait()
    held = []
    for _ in range(25):  # 250 MB, 10 of them in 20 ms
        held.append(b"x" * 10_000_000)
        time.sleep(0.02)
    time.sleep(60)
if what == "sleep":
    time.sleep(60)
if what in ("fill", "fill temporarily"):
    place = folder / "work" if what == "fill" else pathlib.Path(tempfile.mkdtemp())
    (place / "large").write_bytes(bytes(2_000_000))
    time.sleep(60)
if what == "leave":
    (pathlib.Path(tempfile.mkdtemp()) / "photo.jpg").touch()
    os.kill(os.getpid(), 9)
if what == "fail":
    print(json.dumps({"refused": "IMG_0.jpg: too dark."}), file=sys.stderr, flush=True)
    sys.exit(2)
if what == "bug":
    raise RuntimeError("secret")
stage("Counting", done=1, of=2)
(folder / "room").mkdir()
(folder / "room" / "room.json").write_text('{"title": "Your room"}')
"""


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Jobs]]:
    """Starts a queue with the pretended worker, which may do something before that; it is closed at the end."""
    opened: list[Jobs] = []

    def begin(before: str = "", **limits: float) -> Jobs:
        worker = [sys.executable, "-S", "-c", before + WORKER]
        opened.append(Jobs(tmp_path / "rooms", worker, Limits(**limits), segmenters=("words",)))  # type: ignore[arg-type]
        return opened[-1]

    yield begin
    for jobs in opened:
        jobs.close()


def asked(what: str) -> RoomOptions:
    return RoomOptions(segmenter="words", words=what)


def photos(folder: Path, count: int = 2) -> list[Upload]:
    """Photos in a folder of their own each, as gradio stores them."""
    listed = []
    for number in range(count):
        path = folder / f"up{number}" / f"IMG_{number}.jpg"
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (20, 30), (number, 0, 0)).save(path)
        listed.append(Upload(path, path.name))
    return listed


def wait(condition: Callable[[], bool], seconds: float = 300.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def assert_done(job: Job) -> None:
    wait(lambda: job.over)
    assert (job.state, job.sentence) == ("done", "")


def test_a_job_passes_its_stages_and_leaves_only_its_room(start: Callable[..., Jobs], tmp_path: Path):
    jobs = start()
    uploads = photos(tmp_path / "uploads")
    job = jobs.submit(uploads)
    wait(lambda: job.over)
    assert job.state == "done"
    assert [(stage.title, stage.done, stage.of) for stage in job.stages] == [("Starting", 0, 0), ("Counting", 1, 2)]
    assert all(stage.seconds is not None for stage in job.stages)
    wait(lambda: not uploads[0].path.parent.exists())
    assert sorted(path.name for path in job.folder.iterdir()) == ["files", "room"]


def test_a_room_is_made_again_of_its_uploads_which_then_belong_to_the_new_one(
    start: Callable[..., Jobs], tmp_path: Path
):
    jobs = start()
    first = jobs.submit(photos(tmp_path / "uploads"))
    assert_done(first)
    wait(lambda: not (tmp_path / "uploads/up1").exists())
    failed = jobs.submit(first.uploads, asked("fail"), earlier=first.identifier)
    wait(lambda: failed.over and not failed.folder.exists())
    assert (first.repeatable, failed.repeatable) == (True, False)
    again = jobs.submit(first.uploads, earlier=first.identifier)
    assert_done(again)
    wait(lambda: not first.repeatable)
    assert again.repeatable
    assert [one.name for one in again.uploads] == ["IMG_0.jpg", "IMG_1.jpg"]
    wait(lambda: [path.name for path in first.folder.iterdir()] == ["room"])
    with pytest.raises(UnusableUploadError, match="Drop them again"):
        jobs.submit(first.uploads)


def test_uploads_of_a_room_go_before_the_time_that_the_page_promises_is_over(
    start: Callable[..., Jobs], tmp_path: Path
):
    jobs = start(uploads_kept_seconds=3600.0)
    job = jobs.submit(photos(tmp_path / "uploads"))
    assert_done(job)
    job.ended = time.time() - 3500
    jobs.expire()
    assert job.repeatable
    job.ended = time.time() - 3550  # the next sweep, after 60 s, would be too late
    jobs.expire()
    assert (job.repeatable, job.room.exists(), jobs.find(job.identifier)) == (False, True, job)


def test_if_rooms_are_too_large_together_uploads_go_first(start: Callable[..., Jobs], tmp_path: Path):
    jobs, made = start(), []
    for number in range(2):
        made.append(jobs.submit(photos(tmp_path / f"uploads{number}")))
        assert_done(made[-1])
        for path in (made[-1].room / "large", made[-1].uploads[0].path):
            path.write_bytes(bytes(1_000_000))
    jobs.limits = replace(jobs.limits, rooms_bytes=3_500_000)  # of 4 MB
    jobs.expire()
    assert [job.repeatable for job in made] == [False, True]
    jobs.limits = replace(jobs.limits, rooms_bytes=2_500_000)
    jobs.expire()
    assert [job.repeatable for job in made] == [False, False]
    assert [job.room.exists() for job in made] == [True, True]


def test_no_uploads_stay_when_the_app_ends_or_was_killed(start: Callable[..., Jobs], tmp_path: Path):
    jobs = start()
    job = jobs.submit(photos(tmp_path / "uploads"))
    assert_done(job)
    wait(lambda: not (tmp_path / "uploads/up1").exists())
    jobs.close()
    assert [path.name for path in job.folder.iterdir()] == ["room"]
    photos(job.folder / "files")  # what a killed one leaves
    found = start().find(job.identifier)
    assert found is not None
    assert [path.name for path in job.folder.iterdir()] == ["room"]
    assert not found.repeatable


def test_jobs_run_one_at_a_time_in_order_and_those_that_wait_know_their_place(start: Callable[..., Jobs]):
    jobs = start()
    first, second, third = (
        jobs.submit((), asked("sleep"), True),
        jobs.submit((), example=True),
        jobs.submit((), example=True),
    )
    wait(lambda: first.state == "working")
    assert [jobs.ahead(second), jobs.ahead(third)] == [1, 2]
    jobs.cancel(second)
    jobs.cancel(first)
    wait(lambda: third.over)
    assert (first.state, second.state, third.state) == ("cancelled", "cancelled", "done")
    wait(lambda: not first.folder.exists())
    assert not second.folder.exists()


def test_an_error_becomes_a_sentence_and_the_photos_stay_for_another_try(start: Callable[..., Jobs], tmp_path: Path):
    jobs = start()
    uploads = photos(tmp_path / "uploads")
    job = jobs.submit(uploads, asked("fail"))
    wait(lambda: job.over)
    assert job.sentence == "IMG_0.jpg: too dark."
    assert uploads[0].path.exists()
    again = jobs.submit(uploads)
    wait(lambda: again.over)
    assert again.state == "done"


def test_a_bug_shows_no_traceback_to_the_user_but_to_who_runs_the_app(
    start: Callable[..., Jobs], capsys: pytest.CaptureFixture[str]
):
    job = start().submit((), asked("bug"), True)
    wait(lambda: job.over)
    assert job.sentence == BUG
    assert "RuntimeError: secret" in capsys.readouterr().err


def test_workers_that_the_system_refuses_cost_one_job_and_the_next_one_runs(
    start: Callable[..., Jobs], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EAGAIN, "Resource temporarily unavailable")

    with monkeypatch.context() as patched:
        patched.setattr(subprocess, "Popen", refuse)
        jobs = start()
        job = jobs.submit((), example=True)
        wait(lambda: job.over)
    assert (job.state, job.sentence) == ("failed", NO_WORKER)
    assert capsys.readouterr().err == (
        f"semgs: no worker could be started in 3 tries: [Errno {errno.EAGAIN}] Resource temporarily unavailable\n"
    )
    assert_done(jobs.submit((), example=True))


@pytest.mark.parametrize(
    ("death", "why"),
    [
        ("os.kill(os.getpid(), 9)", "the last one was killed, probably because memory ran out"),
        ("sys.exit('no weights')", "the last one ended with code 1: no weights"),
        ("raise ImportError('torch')", "the last one ended with code 1: ImportError: torch"),
        ("sys.exit()", "the last one ended with code 0: it said nothing"),
    ],
)
def test_workers_that_die_at_once_cost_one_job_and_the_next_one_runs(
    start: Callable[..., Jobs], tmp_path: Path, capsys: pytest.CaptureFixture[str], death: str, why: str
):
    deadly = tmp_path / "deadly"
    deadly.touch()
    jobs = start(f"import os, sys\nif os.path.exists({str(deadly)!r}): {death}\n")
    job = jobs.submit((), example=True)
    wait(lambda: job.over)
    assert (job.state, job.sentence) == ("failed", NO_WORKER)
    assert capsys.readouterr().err == f"semgs: no worker could be started in 3 tries: {why}\n"
    wait(lambda: not job.folder.exists())
    deadly.unlink()
    assert_done(jobs.submit((), example=True))


def test_a_worker_that_dies_before_it_has_begun_costs_no_job(
    start: Callable[..., Jobs], tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    once = tmp_path / "once"
    jobs = start(f"import os\ntry: os.mkdir({str(once)!r}); os.kill(os.getpid(), 9)\nexcept FileExistsError: pass\n")
    assert_done(jobs.submit((), example=True))
    assert capsys.readouterr().err == ""


def test_a_job_that_has_not_begun_can_be_cancelled_and_is_not_tried_again(start: Callable[..., Jobs]):
    jobs = start()
    job = jobs.submit((), asked("mute"), True)
    wait(lambda: job.state == "working")
    jobs.cancel(job)
    assert_done(jobs.submit((), example=True))
    assert (job.state, job.folder.exists()) == ("cancelled", False)


def test_a_worker_that_is_killed_ends_its_job_though_what_it_started_lives_on(start: Callable[..., Jobs]):
    job = start().submit((), asked("orphan"), True)
    wait(lambda: job.over)
    assert job.sentence == KILLED


def test_jobs_go_on_after_the_terminal_is_gone(start: Callable[..., Jobs], monkeypatch: pytest.MonkeyPatch):
    class Gone(io.StringIO):
        def write(self, text: str) -> int:
            raise OSError(errno.EIO, "Input/output error")

    jobs = start()
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stderr", Gone())
        job = jobs.submit((), asked("bug"), True)
        wait(lambda: job.over)
        assert job.sentence == BUG
        assert_done(jobs.submit((), example=True))


@pytest.mark.parametrize(
    ("number", "sentence"),
    [
        (errno.ENOSPC, "The files cannot be kept: No space left on device. Try again in some minutes."),
        (errno.ENOENT, "The files are no longer on the server. Drop them again."),
    ],
)
def test_a_full_disk_and_uploads_that_vanish_are_told_and_nothing_is_left(
    start: Callable[..., Jobs], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, sentence: str
):
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    jobs, uploads = start(), photos(tmp_path / "up")
    monkeypatch.setattr(os, "link", refuse)
    monkeypatch.setattr(shutil, "copyfile", refuse)
    with pytest.raises(UnusableUploadError) as raised:
        jobs.submit(uploads)
    assert str(raised.value) == sentence
    assert sorted(path.name for path in jobs.folder.iterdir()) == ["temporary", "uploads"]


def test_a_job_that_takes_too_long_is_stopped(start: Callable[..., Jobs]):
    job = start(seconds=0.3).submit((), asked("sleep"), True)
    wait(lambda: job.over)
    assert job.sentence.startswith("This took more than")


@pytest.mark.parametrize("what", ["grow", "child grows"])
def test_a_job_that_takes_too_much_memory_is_killed_with_all_that_it_started(start: Callable[..., Jobs], what: str):
    jobs = start(memory_bytes=100_000_000)
    job = jobs.submit((), asked(what), True)
    wait(lambda: job.state == "working" and jobs._process is not None)
    group = jobs._process.pid  # type: ignore[union-attr]
    wait(lambda: job.over)
    assert job.sentence == TOO_MUCH.format(gb=0.1)
    wait(lambda: group_bytes(group) == 0)
    assert_done(jobs.submit((), example=True))


@pytest.mark.parametrize("what", ["fill", "fill temporarily"])
def test_a_job_that_fills_the_disk_is_killed(start: Callable[..., Jobs], what: str):
    jobs = start(disk_bytes=1_000_000)
    job = jobs.submit((), asked(what), True)
    wait(lambda: job.over)
    assert job.sentence == TOO_LARGE.format(gb=0.001)
    assert_done(jobs.submit((), example=True))
    assert content_of(jobs.folder)[1] < 1000


def test_temporary_files_of_a_worker_that_is_killed_do_not_stay(start: Callable[..., Jobs]):
    jobs = start()
    job = jobs.submit((), asked("leave"), True)
    wait(lambda: job.over)
    assert job.sentence == KILLED
    wait(lambda: not any("photo.jpg" in names for _, _, names in os.walk(jobs.folder)))  # while others delete them
    assert_done(jobs.submit((), example=True))


def test_a_job_may_take_nine_tenths_of_what_is_free_when_it_starts(
    start: Callable[..., Jobs], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("semgs.app.jobs.free_bytes", lambda: 100e6)
    job = start().submit((), asked("grow"), True)
    wait(lambda: job.over)
    assert job.sentence.startswith("This needed more than 0.1 GB of memory")


def test_a_full_queue_refuses_more(start: Callable[..., Jobs]):
    jobs = start(waiting=1)
    first = jobs.submit((), asked("sleep"), True)
    wait(lambda: first.state == "working")
    jobs.submit((), example=True)
    with pytest.raises(UnusableUploadError, match="waiting already"):
        jobs.submit((), example=True)


def test_files_of_jobs_that_wait_have_a_limit(start: Callable[..., Jobs], tmp_path: Path):
    uploads = [photos(tmp_path / f"uploads{number}") for number in range(3)]
    for one in uploads:
        one[0].path.write_bytes(bytes(1_000_000))
    size = sum(path.stat().st_size for one in uploads[:2] for path in (one[0].path, one[1].path))
    jobs = start(uploads_bytes=size)
    working = jobs.submit((), asked("sleep"), True)
    wait(lambda: working.state == "working")
    first, _ = (jobs.submit(one) for one in uploads[:2])
    with pytest.raises(UnusableUploadError, match="2 rooms are waiting already"):
        jobs.submit(uploads[2])
    jobs.cancel(first)
    jobs.submit(uploads[2])


def test_a_second_click_on_a_page_makes_no_second_room(start: Callable[..., Jobs]):
    jobs = start()
    with ThreadPoolExecutor(8) as clicks:
        found = list(clicks.map(lambda page: jobs.submit((), asked("sleep"), True, page), ["a", "a", "a", "b"]))
    assert found[0] is found[1] is found[2] is not found[3]
    jobs.cancel(found[0])
    assert jobs.submit((), asked("sleep"), True, "a") is not found[0]
    assert jobs.submit((), asked("sleep"), True) is not jobs.submit((), asked("sleep"), True)


def test_rooms_expire_and_others_survive_a_restart(start: Callable[..., Jobs]):
    jobs = start(kept_seconds=3600.0)
    job = jobs.submit((), example=True)
    wait(lambda: job.over)
    jobs.close()
    (jobs.folder / ("a" * 20)).mkdir()  # what a killed app leaves
    second = start(kept_seconds=3600.0)
    found = second.find(job.identifier)
    assert found is not None
    assert found.state == "done"
    assert not (jobs.folder / ("a" * 20)).exists()
    found.ended -= 3601
    second.expire()
    assert second.find(job.identifier) is None
    assert not job.folder.exists()


def test_a_job_that_made_no_room_is_forgotten_after_ten_minutes(start: Callable[..., Jobs]):
    jobs = start()
    job = jobs.submit((), asked("mute"), True)
    wait(lambda: job.state == "working")
    jobs.cancel(job)
    for minutes, known in ((9.9, True), (10.1, False)):
        job.ended = time.time() - 60 * minutes
        jobs.expire()
        assert (jobs.find(job.identifier) is job) is known


@pytest.mark.parametrize(
    "line", ['{"stage": "x", "of": 1e999}', "{" + 5000 * '"a": {', '{"stage": "x", "done": []}', "{}"]
)
def test_a_line_that_is_no_stage_is_none(line: str) -> None:
    job = Job("x", Path(), Request("example", [], "", {}), "a zip")
    assert not _note_report(job, line)
    assert job.stages == []


def test_in_a_worker_libraries_that_print_past_python_are_not_heard() -> None:
    """libpng prints the name of a colour profile: it would pass for a stage."""
    lines = "import os, sys; from semgs.app.worker import speak_alone; speak_alone()"
    program = f"{lines}; os.write(2, b'libpng'); os.system('echo child >&2'); print('ours', file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=120)
    assert done.stderr == "ours\n"


def test_a_line_of_a_worker_is_kept_up_to_a_limit(tmp_path: Path):
    script = "import sys; sys.stderr.write('a library: ' + 9_000_000 * 'x' + '\\nsecond\\n')"
    job = Job("a" * 20, tmp_path, Request("example", [], str(tmp_path), {}), "")
    log: deque[str] = deque(maxlen=10)
    with subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.PIPE, text=True) as process:
        _listen(job, process, log)
    assert [len(line) for line in log] == [4096, 6]
    assert log[0].startswith("a library: xxx")


def test_of_too_many_rooms_the_oldest_go_and_the_newest_stays(start: Callable[..., Jobs]):
    jobs = start()
    made = []
    for _ in range(3):
        made.append(jobs.submit((), example=True))
        wait(lambda: made[-1].over)
        (made[-1].room / "large").write_bytes(bytes(1_000_000))
    jobs.limits = replace(jobs.limits, rooms_bytes=2_500_000)
    jobs.expire()
    assert [jobs.find(job.identifier) is None for job in made] == [True, False, False]
    assert [job.folder.exists() for job in made] == [False, True, True]
    jobs.limits = replace(jobs.limits, rooms_bytes=10)
    jobs.expire()
    assert [job.folder.exists() for job in made] == [False, False, True]  # somebody looks at it now


def test_old_uploads_are_deleted_although_others_disappear_meanwhile(start: Callable[..., Jobs]):
    jobs = start()
    (jobs.uploads / "gone").symlink_to("nowhere")  # listed, and not there
    old, new, broken_off = (jobs.uploads / name for name in ("old", "new", "tmp_broken_off"))
    for folder in (old, new):
        folder.mkdir()
    broken_off.touch()
    for path in (old, broken_off):
        os.utime(path, (0.0, time.time() - UPLOAD_SECONDS - 1))
    jobs.expire()
    assert [path.exists() for path in (old, broken_off, new)] == [False, False, True]
    shutil.rmtree(jobs.uploads)  # the user's cache may be emptied at any time
    jobs.expire()


@pytest.mark.parametrize(
    "options",
    [
        {"views": 9}, {"segmenter": "/etc/passwd"}, {"depth": "hf:a/b"}, {"words": "mug"}, {"segmenter": "words", "words": "mug, --out"},
        {"first": 1}, {"first": 1, "second": 1, "metres": 1.0}, {"first": 1, "second": 2, "metres": 1e9},
    ],
)  # fmt: skip
def test_options_that_the_page_does_not_offer_are_refused(options: dict):
    with pytest.raises(UnusableUploadError):
        RoomOptions(**options).check(("words",), ())


def test_the_scale_is_that_of_two_photos_by_their_names():
    options = RoomOptions(first=1, second=4, metres=1.25)
    photos = {1: "IMG_7.jpg", 2: "IMG_8.jpg", 4: "IMG_10.jpg"}  # the third is damaged
    assert options.scale_from(photos) == ("IMG_7.jpg", "IMG_10.jpg", "1.25")
    assert options.scale_from({}) == RoomOptions().scale_from(photos) == ()
    for number in (3, 5):
        with pytest.raises(UnusableUploadError, match=rf"^Photo {number} cannot give the scale, [^.]+\. [^.]+\.$"):
            RoomOptions(first=1, second=number, metres=1.0).scale_from(photos)
