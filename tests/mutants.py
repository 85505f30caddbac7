"""Plant errors, one at a time, in a copy of the source, and see that the tests meant for each one fail.

    python tests/mutants.py               all of them (`make mutants`)
    python tests/mutants.py depth swin    those whose name or file holds one of these words

There is a copy for each of two runs at a time, in build/mutants. Before anything is planted the named tests must pass in
each, which also fills its caches. Tests run in processes that are forked off one that has imported torch, which takes
longer than most of them. Where an error is inside a kernel, or in a number that kernels are compiled with, kernels run
uncompiled: compiling one anew for every error would take longer still.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import re
import resource
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from planted import MUTANTS, Mutant

ROOT = Path(__file__).resolve().parent.parent
BUILD = ROOT / "build" / "mutants"
NOT_COPIED = {
    ".git", ".venv", "build", "dist", "runs", "out", "demo", ".mypy_cache", ".ruff_cache", ".pytest_cache",
    ".fuzz", ".faults", ".mutants",
}  # fmt: skip
"""What lies in the root beside the source."""

SECONDS = 30.0
"""The longest that the tests of one error may take, where --seconds says nothing else: of a processor's time, so that a
busy machine does not fail them."""

PATIENCE = 5
"""How much longer by the clock than by the processor."""

MINUTES = 60
"""The longest that all may take."""

SURVIVORS = 1
"""How many errors may be missed by every test."""

COMPILED = re.compile(r"_kernels\.py$|rendering/rules\.py$")
"""Files whose content is compiled."""

IMPORTED = ["torch", "torchmetrics.functional.classification", "beartype", "pytest"]
"""What every run of tests would import, but for what pytest wants to see first."""

OPTIONS = [
    # The tests of the tables themselves would notice every error.
    "-x", "-q", "-rfE", "--tb=no", "-p", "no:cacheprovider", "--deselect=tests/test_mutants",
    "-p", "pytest_timeout", "-p", "xdist", "-m", "not long and not gpu",
]  # fmt: skip
"""How pytest runs the tests of an error."""

FAILED = re.compile(r"^(?:FAILED|ERROR) (\S.*?)(?: - .*)?$", re.MULTILINE)
"""A test that pytest names in its summary."""

forked = multiprocessing.get_context("forkserver")


@dataclass(frozen=True)
class Outcome:
    """What tests said.

    Attributes:
        failed: the first test that failed, "" if all passed.
        seconds: that they took.
        late: whether they were cut off.
    """

    failed: str
    seconds: float
    late: bool = False

    def __str__(self) -> str:
        return self.failed or ("NOT IN TIME" if self.late else "SURVIVED")


def planted(mutant: Mutant, root: Path) -> str:
    """The text of the mutant's file with its error.

    Raises:
        ValueError: the text that it replaces is not there exactly once.
    """
    text = (root / mutant.file).read_text(encoding="utf-8")
    found = text.count(mutant.before)
    if found != 1:
        raise ValueError(f"{mutant.name!r}: {mutant.file} holds {mutant.before!r} {found} times; expected once")
    return text.replace(mutant.before, mutant.after)


def main() -> int:
    """Run what is asked for and print a table; 1 if too many errors survive, 2 if tests fail without one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", help="parts of names or files; none is all")
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help="the longest that the tests of one error may take"
    )
    parser.add_argument("--jobs", type=int, default=2, help="how many errors to try at a time")
    given = parser.parse_args()
    mutants = [one for one in MUTANTS if not given.words or any(word in one.name + one.file for word in given.words)]
    for mutant in mutants:
        planted(mutant, ROOT)
    os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    forked.set_forkserver_preload(IMPORTED)
    return tried_all(mutants, given.seconds, given.jobs)


def tried_all(mutants: Sequence[Mutant], seconds: float, jobs: int) -> int:
    """Try each error in a copy of its own; the exit code."""
    began = time.monotonic()
    copies: SimpleQueue[Path] = SimpleQueue()

    def left() -> float:
        return began + 60 * MINUTES - time.monotonic()

    def tried(mutant: Mutant, tests: Sequence[str], limit: float) -> Outcome:
        copy = copies.get()
        try:
            with changed(copy / mutant.file, planted(mutant, copy)):
                return outcome(copy, tests, limit, min(PATIENCE * limit, left()), compiled=runs_compiled(mutant))
        finally:
            copies.put(copy)

    with ThreadPoolExecutor(jobs) as pool:
        made = [copied(BUILD / str(job)) for job in range(jobs)]
        print("their tests without an error ...", flush=True)
        for compiled in (True, False):
            tests = sorted({test for one in mutants if runs_compiled(one) == compiled for test in one.tests})

            def without_an_error(copy: Path, tests: Sequence[str] = tests, compiled: bool = compiled) -> Outcome:
                return outcome(copy, tests, left(), left(), compiled=compiled)

            for result in pool.map(without_an_error, made if tests else ()):
                if result.failed or result.late:
                    print(f"must pass first, but: {result}", file=sys.stderr)
                    return 2
        print(f"pass in {time.monotonic() - began:.0f} s\n", flush=True)
        for copy in made:
            copies.put(copy)
        results = pool.map(lambda one: tried(one, one.tests, seconds), mutants)
        missed = shown(mutants, results, "")
        survivors = shown(missed, pool.map(lambda one: tried(one, ("tests",), left()), missed), ", all tests")
    print(
        f"\n{len(mutants)} errors, {len(mutants) - len(missed)} caught by their own tests, {len(survivors)} by none, "
        f"in {(time.monotonic() - began) / 60:.1f} minutes"
    )
    for mutant in missed:
        print(f"missed by its own tests: {mutant.name} ({mutant.file})")
    return int(len(survivors) > SURVIVORS)


def runs_compiled(mutant: Mutant) -> bool:
    """Whether kernels are compiled in the tests of an error."""
    return not COMPILED.search(mutant.file)


def shown(mutants: Sequence[Mutant], results: Iterator[Outcome], what: str) -> list[Mutant]:
    """Print each result as it comes; the errors that no test caught."""
    missed = []
    for mutant, result in zip(mutants, results, strict=True):
        print(f"{result.seconds:5.1f} s  {mutant.name}{what}: {result}", flush=True)
        if not result.failed:
            missed.append(mutant)
    return missed


@contextmanager
def changed(path: Path, text: str) -> Iterator[None]:
    """A file with another text, which is then as it was; neither leaves bytecode to the other."""
    whole, stat = path.read_text(encoding="utf-8"), path.stat()

    def forget() -> None:
        for bytecode in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
            bytecode.unlink()

    path.write_text(text, encoding="utf-8")
    forget()
    try:
        yield
    finally:
        path.write_text(whole, encoding="utf-8")
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))  # compiled kernels are known by it
        forget()


def outcome(copy: Path, tests: Sequence[str], seconds: float, clock: float, *, compiled: bool) -> Outcome:
    """Run tests in a copy up to the first that fails.

    Raises:
        RuntimeError: they could not even be collected: the planted text is no program.
    """
    began = time.monotonic()
    code, said = ended(clock, run_tests, copy, compiled, seconds, tests)
    if code is None:
        return Outcome("", time.monotonic() - began, late=True)
    failed = FAILED.search(said)
    if code != (1 if failed else 0):
        raise RuntimeError(f"pytest ended with {code}:\n{said}")
    return Outcome(failed[1] if failed else "", time.monotonic() - began)


def ended(clock: float, work: Callable[..., None], copy: Path, *arguments: Any) -> tuple[int | None, str]:
    """Run `work(copy, *arguments)` in a forked process; its exit code, None if it was cut off, and what it printed.

    Args:
        clock: the longest that it may take.
    """
    run = forked.Process(target=work, args=(copy, *arguments))
    run.start()
    run.join(max(1.0, clock))
    if run.is_alive():
        run.kill()
        with suppress(ProcessLookupError):  # it had not come so far as to lead a group
            os.killpg(run.pid, signal.SIGKILL)  # type: ignore[arg-type]
        run.join()
    code = None if run.exitcode in (-signal.SIGKILL, -signal.SIGXCPU) else run.exitcode
    return code, (copy.parent / "said").read_text(encoding="utf-8", errors="replace")


def run_tests(copy: Path, compiled: bool, seconds: float, tests: Sequence[str]) -> None:
    """Be pytest in a copy: its verdict is the exit code."""
    enter(copy, compiled, seconds)
    import pytest

    sys.exit(int(pytest.main([*OPTIONS, *tests])))


def enter(copy: Path, compiled: bool, seconds: float) -> None:
    """Make this process one of a copy, with a limit of CPU time and its output in a file beside the copy."""
    os.setpgid(0, 0)
    limit = max(1, round(seconds))
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 1))
    threading.Thread(target=end_with_the_run, daemon=True).start()
    os.chdir(copy)
    with (copy.parent / "said").open("w", encoding="utf-8") as said:
        os.dup2(said.fileno(), 1)
        os.dup2(said.fileno(), 2)
    os.environ |= {
        "PYTHONPATH": str(copy),
        "NUMBA_CACHE_DIR": str(copy.parent / "compiled"),
        "NUMBA_DISABLE_JIT": "0" if compiled else "1",
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",  # it would warn of plugins of other libraries that are imported already
    }
    sys.path[:] = [str(copy), *(one for one in sys.path if one not in ("", str(ROOT), str(ROOT / "tests")))]


def end_with_the_run() -> None:
    """Wait until what started these tests is gone, then be gone with all that they started."""
    run = multiprocessing.parent_process()
    if run is not None:
        run.join()
        os.killpg(0, signal.SIGKILL)


def copied(folder: Path) -> Path:
    """A copy made anew, with the times of its files, by which compiled kernels are known; `shared` is beside it."""
    copy = folder / "semgs"
    if copy.exists():
        shutil.rmtree(copy)

    def left_out(where: str, names: list[str]) -> set[str]:
        return {"__pycache__"} | (NOT_COPIED if Path(where) == ROOT else set())

    shutil.copytree(ROOT, copy, ignore=left_out)
    beside, shared = folder / "shared", ROOT.parent / "shared"
    if shared.is_dir() and not beside.exists():
        beside.symlink_to(shared)
    return copy


def page() -> str:
    """All errors as a page of the docs; docs/conf.py calls this when the site is built."""
    packages = {one.file.split("/")[1] for one in MUTANTS}
    parts = [
        "# Planted errors",
        f"`make mutants` plants each of these {len(MUTANTS)} errors, one at a time, and checks that a test fails ([Testing](testing.md#planted-errors)).",
    ]
    for package in sorted(packages):
        rows = ["| error | planted in | caught by |", "|---|---|---|"]
        for one in MUTANTS:
            _, folder, file = one.file.split("/", 2)
            if folder == package:
                files = dict.fromkeys(test.removeprefix("tests/").partition("::")[0] for test in one.tests)
                rows.append(f"| {one.name} | `{file}` | {', '.join(f'`{test}`' for test in files)} |")
        parts += [f"## {package}", "\n".join(rows)]
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    sys.exit(main())
