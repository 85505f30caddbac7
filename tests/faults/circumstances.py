"""Commands in bad circumstances: no disk, memory, permission or home, signals, files that shrink. Each check returns what was wrong."""

from __future__ import annotations

import ctypes
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from faults.cases import CASES, Case, incomplete, lay_inputs, tree
from faults.forked import Ended, command, end, run, start

ROOT = Path(__file__).resolve().parents[2]
CLONE_NEWNS, MS_RDONLY, MS_REMOUNT, MS_REC, MS_PRIVATE = 0x20000, 1, 32, 16384, 1 << 18
"""Flags of Linux's `unshare` and `mount`."""

CPU_SECONDS, WALL_SECONDS = 2.0, 20.0
"""How long a command may take to end after a signal; the second is for machines that do other things too."""


SLOW = "took"
"""How the finding of a command that took too long begins."""


def laid(folder: Path) -> Path:
    """The inputs of all commands."""
    ended = run(lambda: lay_inputs(folder) or 0, folder.parent / "log.txt")
    assert ended.code == 0, ended.output
    return folder


def refused(ended: Ended, *told: str) -> list[str]:
    """What is wrong with the end of a command that had to refuse: code 2 and one line that says one of some texts."""
    line = ended.output.strip().splitlines()[-1:] or [""]
    found = []
    if ended.code != 2:
        found.append(f"ended with {ended.code}: {ended.output[-600:]}")
    elif "Traceback" in ended.output or not any(text in line[0] for text in told):
        found.append(f"said {ended.output[-600:]}")
    return found


@contextmanager
def small_disk(folder: Path, kilobytes: int) -> Iterator[None]:
    """A disk of that size at a folder, which only this process sees.

    Raises:
        PermissionError: this process may not mount.
    """
    libc = ctypes.CDLL(None, use_errno=True)

    def call(name: str, *arguments: Any) -> None:
        if getattr(libc, name)(*arguments):
            raise PermissionError(ctypes.get_errno(), os.strerror(ctypes.get_errno()), name)

    call("unshare", CLONE_NEWNS)
    call("mount", None, b"/", None, MS_REC | MS_PRIVATE, None)
    call("mount", b"tmpfs", os.fsencode(folder), b"tmpfs", 0, f"size={kilobytes}k".encode())
    yield


def can_mount() -> bool:
    """Whether this process may mount a small disk."""

    def work() -> int:
        with small_disk(Path("/tmp"), 64):
            return 0

    return run(work, Path(os.devnull)).code == 0


def disk_full(case: Case, inputs: Path, folder: Path, kilobytes: int) -> list[str]:
    """A command writes to a disk that is too small for its results: it says so, and what was there stays."""
    place = folder / "disk"
    place.mkdir(exist_ok=True)
    before = folder / "before"
    if not before.exists():
        made = run(command(case.before(inputs, before)), folder / "log.txt")
        assert made.code == 0, made.output
    report = folder / "left.txt"

    def work() -> int:
        with small_disk(place, kilobytes + sum(-(-len(data) // 4096) * 4 for data in tree(before).values())):
            shutil.copytree(before, place / "out")
            code = command(case.command(inputs, place / "out"))()
            there, after = tree(before), tree(place / "out")
            lost = [name for name in there if name not in after]
            cut = [name for name, data in after.items() if not case.fits_anywhere(name) and incomplete(name, data)]
            parts = [str(path) for path in place.rglob("*.part")]
            report.write_text(
                "\n".join([*(f"{name} is lost" for name in lost), *(f"{name} is cut" for name in cut), *parts])
            )
            return code

    ended = run(work, folder / "log.txt")
    said = (
        [] if ended.code == 0 else refused(ended, "the disk is full", "kB are free", "MB are free")
    )  # it may just fit
    return said + report.read_text().splitlines()


def read_only(case: Case, inputs: Path, folder: Path) -> list[str]:
    """A command is to write to a disk that is mounted read-only."""
    place = folder / "disk"
    place.mkdir(exist_ok=True)

    def work() -> int:
        with small_disk(place, 1024):
            ctypes.CDLL(None).mount(None, os.fsencode(place), None, MS_REMOUNT | MS_RDONLY, None)
            return command(case.command(inputs, place / "out"))()

    return refused(run(work, folder / "log.txt"), "Read-only file system")


def no_permission(case: Case, inputs: Path, folder: Path) -> list[str]:
    """A command is to write to a folder that it may not write to."""
    from privileges import permissions_hold

    closed = folder / "closed"
    closed.mkdir(mode=0o500, exist_ok=True)

    def work() -> int:
        with permissions_hold():
            return command(case.command(inputs, closed / "out"))()

    return refused(run(work, folder / "log.txt"), "Permission denied")


def shrinking(case: Case, inputs: Path, folder: Path, suffix: str) -> list[str]:
    """The first input file with a suffix loses its second half just after it was opened."""
    copy = folder / "shrinking"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(inputs, copy)

    def work() -> int:
        opened: list[Path] = []

        def hook(event: str, arguments: tuple[Any, ...]) -> None:
            if opened and event != "os.truncate":
                path = opened.pop()
                os.truncate(path, path.stat().st_size // 2)
            if event == "open" and str(arguments[0]).startswith(str(copy)) and str(arguments[0]).endswith(suffix):
                path = Path(str(arguments[0]))
                if path.stat().st_size > 1:
                    opened.append(path)

        sys.addaudithook(hook)
        return command(case.command(copy, folder / "out"))()

    ended = run(work, folder / "log.txt")
    return [] if ended.code == 0 else refused(ended, str(copy), "is full", "scenes")


def stopped(case: Case, inputs: Path, folder: Path, sent: int, share: float, length: float) -> list[str]:
    """A signal arrives after a share of a command's time: it ends in time with its code, and leaves nothing.

    A command that was only too slow gets two more tries, because the CPU time of a virtual machine includes what its host took.
    """
    for _ in range(3):
        found = _stopped_once(case, inputs, folder, sent, share, length)
        if not found or any(not said.startswith(SLOW) for said in found):
            break
    return found


def _stopped_once(case: Case, inputs: Path, folder: Path, sent: int, share: float, length: float) -> list[str]:
    """One try of `stopped`."""
    out = folder / "stopped"
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    log, ready = folder / "log.txt", folder / "ready"
    ready.unlink(missing_ok=True)

    def work() -> int:
        from semgs.cli import main as module

        signal.signal(signal.SIGINT, signal.default_int_handler)
        begin = module._run

        def begun(arguments: list[str]) -> int:
            ready.touch()  # from here on the command takes care of signals
            return begin(arguments)

        module._run = begun
        return module.main(case.command(inputs, out / "out"))

    child = start(work, log)
    while not ready.exists():
        time.sleep(0.001)
    time.sleep(0.05 + share * length)
    used, began = _cpu_seconds(child), time.monotonic()
    os.kill(child, sent)
    timer = threading.Timer(WALL_SECONDS, os.kill, (child, signal.SIGKILL))
    timer.start()
    ended = end(child, log)
    timer.cancel()
    found = []
    allowed = (0,) if ended.code == 0 else (128 + sent,)  # it had finished, or it saves and ends (train)
    if ended.code not in allowed or "Traceback" in ended.output:
        found.append(f"ended with {ended.code}: {ended.output[-600:]}")
    if ended.cpu_seconds - used > CPU_SECONDS and not (ended.code == 0 and case.name != "train"):
        took = f"{ended.cpu_seconds - used:.1f} s of CPU time and {time.monotonic() - began:.1f} s to end"
        found.append(f"{SLOW} {took}")
    if case.units == (".",) and any(path.name.endswith(".part") for path in out.iterdir()):
        found.append(f"left {[path.name for path in out.iterdir()]}")
    return found


def _cpu_seconds(child: int) -> float:
    """CPU time that a process has used."""
    try:
        fields = Path(f"/proc/{child}/stat").read_text().rsplit(")", 1)[1].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def alone(
    arguments: Sequence[str], prefix: Sequence[str] = (), environment: Mapping[str, str | None] = {}, after: float | None = None,
    sent: int = signal.SIGINT,
) -> subprocess.CompletedProcess[bytes]:  # fmt: skip
    """A command in a new interpreter, behind a prefix, with other variables (None: without it); stopped `after` seconds."""
    variables = {"OMP_NUM_THREADS": "1", **os.environ, "PYTHONPATH": str(ROOT), **environment}
    process = subprocess.Popen(
        [*prefix, sys.executable, "-m", "semgs", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        env={name: value for name, value in variables.items() if value is not None}, cwd="/",
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler) and None,
    )  # fmt: skip
    if after is not None:
        time.sleep(after)
        process.send_signal(sent)
    out, errors = process.communicate(timeout=300)
    return subprocess.CompletedProcess(process.args, process.returncode, out, errors)


def finishes(inputs: Path, out: Path, **how: Any) -> list[str]:
    """A reconstruction in a new interpreter ends with a complete folder."""
    done = alone(CASES["reconstruct"].command(inputs, out), **how)
    if done.returncode or not (out / "report.html").is_file():
        return [f"ended with {done.returncode}: {done.stderr.decode(errors='replace')[-600:]}"]
    return []


def without_home(inputs: Path, folder: Path) -> list[str]:
    """Neither a home folder nor a folder for caches exists."""
    nowhere = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"), "/nonexistent")
    return finishes(inputs, folder / "homeless", environment={**nowhere, "NUMBA_CACHE_DIR": None})


def read_only_install(inputs: Path, folder: Path) -> list[str]:
    """The package, its caches and the home folder are read-only, and nothing is compiled yet."""
    home = folder / "home"
    home.mkdir(exist_ok=True)
    script = 'set -e; for place in "$0" "$1"; do mount --bind "$place" "$place"; mount -o remount,bind,ro "$place"; done; shift; exec "$@"'
    prefix = ["unshare", "-m", "sh", "-c", script, str(ROOT), str(home)]
    return finishes(
        inputs, folder / "installed", prefix=prefix, environment={"HOME": str(home), "XDG_CACHE_HOME": str(home)}
    )


def odd_paths(inputs: Path, folder: Path) -> list[str]:
    """Paths have spaces and letters that the locale C does not know."""
    place = folder / "Küche † eins"
    shutil.copytree(inputs, place / "die Räume")
    plain = {"LC_ALL": "C", "LANG": None, "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    return finishes(place / "die Räume", place / "das Ergebnis", environment=plain)


def three_gigabytes(inputs: Path, folder: Path) -> list[str]:
    """The address space is 3 GB: the command finishes, or says that memory is short."""
    done = alone(CASES["reconstruct"].command(inputs, folder / "limited"), ["prlimit", f"--as={3 << 30}"])
    said = done.stderr.decode(errors="replace")
    if done.returncode == 0 or (done.returncode == 2 and "memory" in said and said.count("\n") == 1):
        return []
    return [f"ended with {done.returncode}: {said[-600:]}"]


def stopped_at_start(inputs: Path, folder: Path, sent: int, after: float) -> list[str]:
    """A signal arrives while a new interpreter starts or imports."""
    done = alone(CASES["reconstruct"].command(inputs, folder / "started"), after=after, sent=sent)
    said = done.stderr.decode(errors="replace")
    # Before Python reaches our code it may print a traceback of its own, and after it the system ends the process: a shell shows the same code.
    if done.returncode in (128 + sent, -sent) and "Traceback" not in said:
        return []
    if "KeyboardInterrupt" in said and str(ROOT / "semgs") not in said:
        return []
    return [f"{after:.2f} s: ended with {done.returncode}: {said[-600:]}"]


def closed_pipe(inputs: Path, folder: Path) -> list[str]:
    """The output has no reader."""
    done = subprocess.run(
        ["sh", "-c", '"$0" "$@" 2>"$ERRORS" | true; cat "$ERRORS"', sys.executable, "-m", "semgs", *CASES["reconstruct"].command(inputs, folder / "piped")],
        capture_output=True, text=True, check=False, env={**os.environ, "PYTHONPATH": str(ROOT), "ERRORS": str(folder / "errors.txt")},
    )  # fmt: skip
    return [done.stdout] if "Traceback" in done.stdout or "Exception" in done.stdout else []


def two_at_once(case: Case, inputs: Path, folder: Path) -> list[str]:
    """Two processes run the same command into one new folder: at least one finishes, and the other says why not or finishes too."""
    place = folder / "both"
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir()
    logs = [folder / f"log{k}.txt" for k in range(2)]
    children = [start(command(case.command(inputs, place / "out")), log) for log in logs]
    ended = [end(child, log) for child, log in zip(children, logs, strict=True)]
    found = [] if any(one.code == 0 for one in ended) else ["neither finished"]
    for one in ended:
        if one.code:
            found += refused(one, "process", "in use", "wrote before", "semgs wrote", "is filling")
    return found


CHECKS: dict[str, Callable[[Path, Path], list[str]]] = {
    "no home": without_home,
    "read-only install": read_only_install,
    "locale C, odd paths": odd_paths,
    "3 GB": three_gigabytes,
    "closed pipe": closed_pipe,
}
"""Checks of one reconstruction each, in a new interpreter."""
