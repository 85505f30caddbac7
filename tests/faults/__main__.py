"""Runs the faults that have no result yet, and prints what was found."""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from faults import circumstances
from faults.cases import CASES
from faults.forked import run, warm
from faults.kills import Bench

PARTS = 5
"""Parts of a command's kills; a finished part is not run again."""


def kills(name: str, count: int, part: int, folder: Path) -> list[str]:
    """What one part of a command's kills found."""
    bench = Bench(CASES[name], folder / "bench")
    done = [bench.kill(k, count) for k in range(part, count, PARTS)]
    return [
        f"{one.stage} {one.number}{', folder with content' if one.resumed else ''}: {said}"
        for one in done
        for said in one.found
    ]


def pieces(count: int | None) -> Iterator[tuple[str, int, Callable[[Path], list[str]]]]:
    """Everything to do: a name, how many cases it has, and what does it in a folder."""
    for name, case in CASES.items():
        total = count or case.kills
        for part in range(min(PARTS, total)):
            yield f"kill {name} {part}", len(range(part, total, PARTS)), lambda folder, name=name, total=total, part=part: kills(name, total, part, folder)  # type: ignore[misc] # fmt: skip
    for name, case in CASES.items():
        for what, sizes in (
            ("disk full", (8, 24, 64)),
            ("read-only", (0,)),
            ("no permission", (0,)),
            ("two at once", (0,)),
        ):

            def act(folder: Path, case=case, what=what, sizes=sizes) -> list[str]:  # type: ignore[no-untyped-def]
                inputs = circumstances.laid(folder / "inputs")
                if what == "disk full":
                    return [
                        f"{size} KB: {said}"
                        for size in sizes
                        for said in circumstances.disk_full(case, inputs, folder, size)
                    ]
                return {
                    "read-only": circumstances.read_only, "no permission": circumstances.no_permission, "two at once": circumstances.two_at_once,
                }[what](case, inputs, folder)  # fmt: skip

            yield f"{what} {name}", len(sizes), act
        for sent in (signal.SIGINT, signal.SIGTERM):
            times = count or 20

            def stop(folder: Path, case=case, sent=sent, times=times) -> list[str]:  # type: ignore[no-untyped-def]
                inputs = circumstances.laid(folder / "inputs")
                began = time.monotonic()
                run(circumstances.command(case.command(inputs, folder / "whole")), folder / "log.txt")
                length = time.monotonic() - began
                return [
                    f"{k} of {times}: {said}" for k in range(times) for said in circumstances.stopped(case, inputs, folder, sent, k / times, length)
                ]  # fmt: skip

            yield f"{sent.name} {name}", times, stop
    for suffix, name in (
        (".jpg", "reconstruct"),
        (".json", "reconstruct"),
        (".png", "prepare"),
        (".safetensors", "export"),
    ):
        yield f"shrinking {suffix} of {name}", 1, lambda folder, name=name, suffix=suffix: circumstances.shrinking(CASES[name], circumstances.laid(folder / "inputs"), folder, suffix)  # type: ignore[misc] # fmt: skip
    for name, check in circumstances.CHECKS.items():
        yield name, 1, lambda folder, check=check: check(circumstances.laid(folder / "inputs"), folder)  # type: ignore[misc]
    for sent in (signal.SIGINT, signal.SIGTERM):
        times = count or 20

        def begin(folder: Path, sent=sent, times=times) -> list[str]:  # type: ignore[no-untyped-def]
            inputs = circumstances.laid(folder / "inputs")
            return [
                said
                for k in range(times)
                for said in circumstances.stopped_at_start(inputs, folder, sent, 0.03 * 1.25**k)
            ]

        yield f"{sent.name} at start", times, begin


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked; 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="faults", description=__doc__)
    parser.add_argument("--only", help="pieces whose names contain this")
    parser.add_argument("--count", type=int, help="kills and signals of each command (100 and 40, 20)")
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time (2)")
    parser.add_argument(
        "--folder", type=Path, default=Path(".faults"), help="results, which are not found again (.faults)"
    )
    asked = parser.parse_args(arguments)
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    asked.folder.mkdir(parents=True, exist_ok=True)
    todo = [(name, cases, act) for name, cases, act in pieces(asked.count) if (asked.only or "") in name]
    warm(name for name in CASES if any(name in piece for piece, _, _ in todo))

    def saved(name: str, cases: int) -> Path:
        return asked.folder.resolve() / f"{name.replace(' ', '_')}-{cases}.json"

    def worker(number: int) -> int:
        for name, cases, act in todo[number :: asked.jobs]:
            file = saved(name, cases)
            if file.exists():
                continue
            began = time.monotonic()
            with tempfile.TemporaryDirectory(prefix="faults") as place:
                try:
                    found = act(Path(place).resolve())
                except Exception as error:
                    found = [f"{type(error).__name__}: {error}"]
            partial = file.with_suffix(".part")
            partial.write_text(json.dumps({"found": found, "seconds": round(time.monotonic() - began, 1)}))
            partial.replace(file)
            print(f"{name:28} {cases:4} cases {len(found):3} found {time.monotonic() - began:6.0f} s", flush=True)
        return 0

    children = []
    for number in range(asked.jobs):
        child = os.fork()
        if not child:
            os._exit(worker(number))
        children.append(child)
    for child in children:
        os.waitpid(child, 0)
    results = {name: json.loads(saved(name, cases).read_text()) for name, cases, _ in todo}
    for name, result in results.items():
        for said in result["found"]:
            print(f"{name}: {said}")
    total = sum(cases for _, cases, _ in todo)
    print(
        f"{total} cases, {sum(len(one['found']) for one in results.values())} found, {sum(one['seconds'] for one in results.values()):.0f} s"
    )
    return int(any(one["found"] for one in results.values()))


if __name__ == "__main__":
    sys.exit(main())
