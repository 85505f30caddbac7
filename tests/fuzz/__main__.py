"""Runs blocks of cases in processes of their own, two at a time, and prints what became of them; a later call resumes."""

from __future__ import annotations

import argparse
import json
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path

from fuzz.cases import BLOCK, Bench, Tally, own_limits, run_block
from fuzz.format import Format
from fuzz.formats import FORMATS
from fuzz.watch import WALL_SECONDS, Watch

NUMBER = struct.Struct("<q")


@dataclass
class Block:
    """What became of a block: the sums of its processes, as kept in a file.

    Attributes:
        read, refused: cases.
        found: (case, what, where).
        seconds: CPU time.
    """

    read: int = 0
    refused: int = 0
    found: list[tuple[int, str, str]] = field(default_factory=list)
    seconds: float = 0.0


def work(form: Format, base: int, block: int, first: int, count: int, folder: Path, only: int | None = None) -> Tally:
    """Run the cases of a block from `first` on in this process; the number of each is in the file `case` before it begins."""
    own_limits(folder)
    watch = Watch(folder)
    bench = Bench(form, block, folder / "bench", watch)
    told, where, _ = bench.run({})
    warm = [bench.run({name: bench.files[name]}) for name in bench.main[:3]]
    if told != "read" or any(one[0] != "read" for one in warm):
        raise SystemExit(f"{form.name}: the seed itself is not read: {told} {where} {warm}")
    with (folder / "case").open("wb", buffering=0) as file:

        def begin(case: int) -> None:
            os.pwrite(file.fileno(), NUMBER.pack(case), 0)

        # Hypothesis and bytes alternate, so the order of cases in time is bytes first; a case is done if it comes before in that order.
        order = [*range(0, count, 2), *range(1, count, 2)]
        done = {block * BLOCK + number for number in order[: order.index(first)]} if first in order else set()
        return run_block(
            bench, base, block, count, lambda case: case == only if only is not None else case not in done, begin
        )


def measured(form: Format, base: int, count: int) -> tuple[int, int]:
    """The lines of a format's readers and how many of them the first cases of each variant execute, in this process."""
    import coverage

    root = Path(__file__).resolve().parents[2]
    counter = coverage.Coverage(
        data_file=None, include=[str(root / module) for module in form.modules], config_file=False
    )
    with tempfile.TemporaryDirectory() as folder:
        own_limits(Path(folder))
        watch = Watch(Path(folder))
        counter.start()
        for block in range(len(form.variants)):
            bench = Bench(form, block, Path(folder) / f"bench{block}", watch)
            run_block(bench, base, block, count, lambda case: True, lambda case: None)
        counter.stop()
    lines = executed = 0
    for module in sorted(path for pattern in form.modules for path in root.glob(pattern)):
        if module.name == "__init__.py":
            continue
        _, statements, _, missing, _ = counter.analysis2(str(module))
        # Lines that run at import are not ours to count: they ran before.
        inside = set(statements) - _at_import(module)
        lines += len(inside)
        executed += len(inside - set(missing))
    return lines, executed


def _at_import(module: Path) -> set[int]:
    """The lines outside functions."""
    import ast

    tree = ast.parse(module.read_text(encoding="utf-8"))
    inside = {
        line
        for one in ast.walk(tree)
        if isinstance(one, ast.FunctionDef)
        for body in one.body
        for line in range(body.lineno, (body.end_lineno or body.lineno) + 1)
    }
    return set(range(1, len(module.read_text(encoding="utf-8").splitlines()) + 1)) - inside


def supervised(form: Format, base: int, block: int, count: int) -> Block:
    """Run a block in processes: another takes over behind a case that ends one."""
    total, first = Block(), 0
    while first is not None:
        with tempfile.TemporaryDirectory(prefix="fuzz") as folder:
            arguments = [form.name, str(base), str(block), str(first), str(count), folder]
            process = subprocess.Popen(
                [sys.executable, "-m", "fuzz", "--work", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
            )  # fmt: skip
            hung = _wait(process, Path(folder) / "case")
            out, errors = process.communicate()
            if process.returncode == 0:
                told = json.loads(out.splitlines()[-1])
                total.read, total.refused = total.read + told["read"], total.refused + told["refused"]
                total.found += [tuple(one) for one in told["found"]]
                total.seconds += told["seconds"]
                return total
            case = _case(Path(folder) / "case")
            if case is None:
                raise SystemExit(f"{form.name}: block {block} did not begin:\n{errors[-3000:]}")
            number = -process.returncode
            said = (
                f"no end in {WALL_SECONDS:.0f} s"
                if hung
                else f"signal {number}"
                if number > 0
                else f"exit code {-number}"
            )
            total.found.append((case, said, errors.strip()[-300:]))
            order = [*range(0, count, 2), *range(1, count, 2)]
            behind = order[order.index(case - block * BLOCK) + 1 :]
            first = behind[0] if behind else None
    return total


def _case(file: Path) -> int | None:
    """The case that a process was at."""
    data = file.read_bytes() if file.exists() else b""
    return NUMBER.unpack(data)[0] if len(data) == NUMBER.size else None


def _wait(process: subprocess.Popen[str], file: Path) -> bool:
    """Wait for a process, and end it if it stays at one case too long."""
    case, since = None, time.monotonic()
    while True:
        try:
            process.wait(2)
            return False
        except subprocess.TimeoutExpired:
            now = _case(file)
            if now != case:
                case, since = now, time.monotonic()
            elif time.monotonic() - since > WALL_SECONDS * (1 if case is not None else 4):
                process.send_signal(signal.SIGKILL)
                return True


def saved(folder: Path, form: Format, base: int, block: int, count: int) -> Block:
    """A block's result, from its file or run now."""
    file = folder / f"{form.name}-{base}-{block}-{count}.json"
    if file.exists():
        return Block(**json.loads(file.read_text()))
    done = supervised(form, base, block, count)
    partial = file.with_suffix(".part")
    partial.write_text(json.dumps(asdict(done)))
    partial.replace(file)
    return done


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is asked; 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--format", choices=sorted(FORMATS), action="append", help="one format; repeatable (all)")
    parser.add_argument("--cases", type=int, help="of each format (10,000, or fewer for slow formats)")
    parser.add_argument("--seed", type=int, default=0, help="of all cases (0)")
    parser.add_argument("--case", type=int, help="run one case of one format again, in this process")
    parser.add_argument(
        "--coverage",
        action="store_true",
        help="count the lines of the readers that --cases execute, 200 per variant if not given",
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes at a time (2)")
    parser.add_argument(
        "--folder", type=Path, default=Path(".fuzz"), help="results of finished blocks, which are not run again (.fuzz)"
    )
    parser.add_argument("--work", nargs=6, help=argparse.SUPPRESS)
    asked = parser.parse_args(arguments)
    if asked.work:
        name, *numbers, place = asked.work
        base, block, first, count = map(int, numbers)
        tally = work(FORMATS[name], base, block, first, count, Path(place))
        print(json.dumps({**asdict(tally), "seconds": time.process_time()}))
        return 0
    chosen = [FORMATS[name] for name in asked.format or FORMATS]
    if asked.case is not None:
        with tempfile.TemporaryDirectory() as place:
            block = asked.case // BLOCK
            print(work(chosen[0], asked.seed, block, 0, BLOCK, Path(place), asked.case))
        return 0
    if asked.coverage:
        for form in chosen:
            lines, executed = measured(form, asked.seed, min(BLOCK, asked.cases or 200))
            print(f"{form.name:14} {executed:5} of {lines:5} lines {executed / lines:6.1%}", flush=True)
        return 0
    asked.folder.mkdir(parents=True, exist_ok=True)
    worst = 0
    print(f"{'format':14} {'cases':>7} {'read':>7} {'refused':>7} {'found':>6} {'CPU s':>7}")
    for form in chosen:
        cases = asked.cases or form.cases
        blocks = [(block, min(BLOCK, cases - block * BLOCK)) for block in range(-(-cases // BLOCK))]
        with ThreadPoolExecutor(asked.jobs) as pool:
            done = list(pool.map(lambda one: saved(asked.folder, form, asked.seed, *one), blocks))  # noqa: B023
        found = [one for block in done for one in block.found]
        read, refused = sum(block.read for block in done), sum(block.refused for block in done)
        print(
            f"{form.name:14} {cases:7} {read:7} {refused:7} {len(found):6} {sum(block.seconds for block in done):7.0f}",
            flush=True,
        )
        kinds = Counter(f"{what} | {where}" for _, what, where in found)
        for kind, count in kinds.most_common(20):
            example = next(case for case, what, where in found if f"{what} | {where}" == kind)
            print(f"    {count} times, first in case {example}: {kind}", flush=True)
        worst |= bool(found)
    return int(worst)


if __name__ == "__main__":
    sys.exit(main())
