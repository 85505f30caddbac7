"""Change the source a little, 200 times, where nobody chose the place, and see that tests notice.

    python tests/mutants_auto.py                 all of them (`make mutants-auto`); a later call goes on where one was cut off
    python tests/mutants_auto.py cameras swin    those in files whose names hold one of these words
    python tests/mutants_auto.py --list          show the changes, try none
    python tests/mutants_auto.py --again         try survivors once more, after a test was written

cosmic-ray's operators make the changes. The 200 are drawn fairly from the places where one of them fits. A place is a
token that some operator changes; it stands for one mutant, whatever the number of its replacements, so that `+` with six
of them is no likelier than `True` with one. Every place has a hash of the seed, its file, its function and its line's text;
the lowest hashes are drawn, at most three in a function, and the hash also chooses the replacement. So each file gets its
share of the places, and a change elsewhere in the code leaves the draw as it is, and with it the results in `.mutants`.

Left out is what no test should notice (annotations, decorators, `if TYPE_CHECKING`, what is raised, `stacklevel`) and what
any test notices, because it raises TypeError: `+` becomes other arithmetic, never a shift.

Which tests run a line is measured once for each file of tests, and again if the file or the source changed. A mutant meets
the tests that run its statement, of its own package and the fastest first, then the other tests of their files, in all up
to 30 CPU seconds. Kernels run uncompiled when they are changed or measured, as in `mutants.py`.
"""

from __future__ import annotations

import argparse
import ast
import hashlib
import json
import os
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass
from itertools import accumulate
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from mutants import (
    COMPILED,
    FAILED,
    IMPORTED,
    OPTIONS,
    PATIENCE,
    ROOT,
    changed,
    copied,
    ended,
    enter,
    forked,
    run_tests,
)
from mutants_equivalent import EQUIVALENT

BUILD = ROOT / "build" / "mutants_auto"
PACKAGES = ("geometry", "objectives", "data", "rendering", "model")
COUNT, PER_FUNCTION, TO_DIE = 200, 3, 0.85
SECONDS, FIRST = 30.0, 40
"""CPU time of the tests that a mutant meets, and how many of them are run first: collecting them all takes a while."""

TEST_SECONDS, MEASURED = 60, 900.0
"""The longest that a test may take, by the clock, to be of use, and that measuring one file of tests may take."""

ALIKE = ({"Add", "Sub", "Mul", "Div", "FloorDiv", "Mod", "Pow"}, {"BitOr", "BitAnd", "BitXor"}, {"LShift", "RShift"},
         {"Eq", "NotEq", "Lt", "LtE", "Gt", "GtE"}, {"Is", "IsNot"}, {"Delete", "USub"}, {"Delete", "Not"}, {"Delete", "Invert"})  # fmt: skip
"""Operators that may replace each other; `==` never becomes `is`, which is the same for what Python stores once."""

OTHERS = {"AddNot", "ReplaceTrueWithFalse", "ReplaceFalseWithTrue", "ReplaceAndWithOr", "ReplaceOrWithAnd", "NumberReplacer",
          "ReplaceBreakWithContinue", "ReplaceContinueWithBreak", "ExceptionReplacer", "ZeroIterationForLoop"}  # fmt: skip

CHANGEABLE = {"operator", "keyword", "number", "comparison", "factor", "not_test", "test", "except_clause",
              "if_stmt", "while_stmt", "assert_stmt", "for_stmt"}  # fmt: skip
"""Nodes that operators of cosmic-ray look at."""

COMPOUND = {"file_input", "if_stmt", "while_stmt", "for_stmt", "try_stmt", "with_stmt", "funcdef", "classdef", "suite"}


@dataclass(frozen=True)
class Place:
    """Where one operator makes one change.

    Attributes:
        file: from the root.
        function: its dotted name, "" outside of functions: such code runs when it is imported.
        lines: the first and the last line of the statement, from 1.
        operator: cosmic-ray's name.
        occurrence: which of the operator's positions in the file.
        key: the hash that draws it.
    """

    file: str
    function: str
    lines: tuple[int, int]
    operator: str
    occurrence: int
    key: str

    @property
    def compiled(self) -> bool:
        """Whether kernels are compiled in its tests."""
        return not COMPILED.search(self.file)

    def changed(self, text: str) -> str:
        """The file's text with the change; "" if there is none or it is no program."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        with suppress(
            SyntaxError, AttributeError
        ):  # AttributeError: `except module.Error`, which cosmic-ray cannot replace
            mutated = mutate_code(text, get_operator(self.operator)(), self.occurrence)
            ast.parse(mutated)
            return mutated
        return ""


@dataclass(frozen=True)
class Mutant:
    """A changed file; `before` and `after` are the first line that differs."""

    place: Place
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.place.file}:{self.place.lines[0]} {self.place.function}: {self.before}  ->  {self.after}"

    @property
    def equivalent(self) -> str:
        """Why no test can tell it from the original, "" if one should."""
        return next((row[3] for row in EQUIVALENT if row[:3] == (self.place.file, self.before, self.after)), "")


@dataclass(frozen=True)
class Verdict:
    """What tests made of a change: `by` is the first that failed, or how else it died, and "" where it survived."""

    key: str
    by: str
    tests: int
    seconds: float


def sensible(name: str) -> bool:
    """Whether an operator of cosmic-ray, by its name, makes changes that a test may or may not notice."""
    kind, *pair = name.removeprefix("core/").split("_")
    return kind in OTHERS or any(set(pair) <= group for group in ALIKE if pair)


def left_out(token: Any) -> bool:
    """Whether a token is where no change counts."""
    child, parent = token, token.parent
    if parent is not None and parent.type == "parameters":
        return True  # the * and / between parameters
    while parent is not None:
        if (
            parent.type in ("decorator", "raise_stmt", "tfpdef")
            or (parent.type == "annassign" and child is parent.children[1])
            or (parent.type == "funcdef" and child is parent.annotation)
            or (parent.type == "if_stmt" and parent.children[1].get_code().strip().endswith("TYPE_CHECKING"))
            or (parent.type == "argument" and parent.children[0].get_code().strip() == "stacklevel")
        ):
            return True
        child, parent = parent, parent.parent
    return False


def function_of(token: Any) -> str:
    """The dotted name of the function that runs a token, "" if the module does."""
    names, child, parent, runs = [], token, token.parent, False
    while parent is not None:
        if parent.type in ("funcdef", "classdef") and child is parent.children[-1]:
            names.append(parent.name.value)
            runs |= parent.type == "funcdef"
        child, parent = parent, parent.parent
    return ".".join(reversed(names)) if runs else ""


def statement_of(token: Any) -> tuple[int, int]:
    """The first and the last line of a token's statement, or of its part in the head of a compound one."""
    node = token
    while node.parent is not None and node.parent.type not in COMPOUND:
        node = node.parent
    return node.start_pos[0], node.get_last_leaf().start_pos[0]


def places(file: str, text: str, seed: int) -> Iterator[Place]:
    """Every place of a file, with the operator that its hash chooses."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    tree = get_ast(text)
    nodes = [node for node in ast_nodes(tree) if node.type in CHANGEABLE]
    options: dict[tuple[int, int, bool], list[tuple[Any, str, int]]] = defaultdict(list)
    for name in filter(sensible, operator_names()):
        operator = get_operator(name)()
        found = (start for node in nodes for start, _ in operator.mutation_positions(node))
        for occurrence, start in enumerate(found):
            token = tree.get_leaf_for_position(start)
            if not left_out(token):
                # `not` in front of a condition is a place of its own, beside that of the condition's first token.
                options[*start, name.endswith("AddNot")].append((token, name, occurrence))
    lines, met = text.splitlines(), Counter[tuple[str, str]]()
    for (line, *_), choices in sorted(options.items()):
        known = function_of(choices[0][0]), lines[line - 1].strip()
        met[known] += 1
        key = hashlib.sha256(f"{seed} {file} {known} {met[known]}".encode()).hexdigest()
        token, name, occurrence = choices[int(key, 16) % len(choices)]
        yield Place(file, known[0], statement_of(token), name, occurrence, key[:16])


def drawn(root: Path, count: int = COUNT, seed: int = 0, packages: Sequence[str] = PACKAGES) -> list[Mutant]:
    """The changes to try, sorted by file and line."""
    files = sorted(path for package in packages for path in (root / "semgs" / package).rglob("*.py"))
    texts = {str(path.relative_to(root)): path.read_text("utf-8") for path in files}
    found = [place for file, text in texts.items() for place in places(file, text, seed)]
    taken: list[Mutant] = []
    in_function = Counter[tuple[str, str]]()
    for place in sorted(found, key=lambda one: one.key):
        text = texts[place.file]
        if len(taken) == count or in_function[place.file, place.function] == PER_FUNCTION:
            continue
        for before, after in zip(text.splitlines(), place.changed(text).splitlines(), strict=False):
            if before != after:
                taken.append(Mutant(place, before.strip(), after.strip()))
                in_function[place.file, place.function] += 1
                break
    print(f"{len(taken)} of {len(found)} places in {len(files)} files", flush=True)
    return sorted(taken, key=lambda one: (one.place.file, one.place.lines, one.place.key))


@dataclass(frozen=True)
class Run:
    """What one file of tests runs.

    Attributes:
        tests: those that pass, with their CPU seconds.
        lines: for each file, which of the tests run each of its lines; a file that was only imported has none.
    """

    tests: dict[str, float]
    lines: dict[str, dict[str, list[str]]]

    def of(self, place: Place) -> set[str]:
        """The tests that run a statement; for one that runs when it is imported, those that run anything of the file."""
        lines = self.lines.get(place.file, {})
        first, last = place.lines
        return {
            test for line, tests in lines.items() if not place.function or first <= int(line) <= last for test in tests
        }


def measure(copy: Path, compiled: bool, seconds: float, tests: str, result: Path) -> None:
    """Run a file of tests in a copy and write which lines each test runs."""
    enter(copy, compiled, seconds)
    import coverage
    import pytest

    watch = coverage.Coverage(data_file=None, include=[f"{copy}/semgs/*"], messages=False)
    seconds_of: dict[str, float] = {}

    class Recorder:
        """Tells coverage which test runs, and notes how long those take that pass."""

        @pytest.hookimpl(wrapper=True)
        def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
            watch.switch_context(item.nodeid)
            began = time.process_time()
            done = yield
            seconds_of[item.nodeid] = time.process_time() - began
            watch.switch_context("")
            return done

        def pytest_runtest_logreport(self, report: Any) -> None:
            if not report.passed:
                useless.add(report.nodeid)

    useless: set[str] = set()
    watch.start()
    options = [one for one in OPTIONS if one != "-x"]
    pytest.main([*options, f"--timeout={TEST_SECONDS}", tests], plugins=[Recorder()])
    watch.stop()
    data = watch.get_data()
    good = {test: round(spent, 3) for test, spent in seconds_of.items() if test not in useless}
    lines = {
        str(Path(file).relative_to(copy)): {
            str(line): there for line, contexts in data.contexts_by_lineno(file).items() if (there := sorted(good.keys() & set(contexts)))
        }
        for file in data.measured_files()
    }  # fmt: skip
    write(result, asdict(Run(good, lines)))
    sys.exit(0)


def write(file: Path, content: Any) -> None:
    """Write JSON that is complete or absent."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_suffix(".part")
    partial.write_text(json.dumps(content))
    partial.replace(file)


def chosen(place: Place, runs: Sequence[Run], seconds: float) -> list[str]:
    """The tests that a changed place meets: those that run it, of its package and the fastest first, then their neighbours."""
    package = place.file.split("/")[1]
    ranked = []
    for run in runs:
        there = run.of(place)
        known = there or (not place.function and place.file in run.lines)
        ranked += [(test not in there, not test.startswith(f"tests/{package}/"), spent, test) for test, spent in run.tests.items() if known]  # fmt: skip
    ranked.sort()
    total = accumulate(spent for _, _, spent, _ in ranked)
    return [test for (*_, test), after in zip(ranked, total, strict=True) if after <= seconds]


def tried(copy: Path, mutant: Mutant, tests: Sequence[str], seconds: float) -> Verdict:
    """Run the tests of a mutant in a copy until one fails."""
    began = time.monotonic()
    by = ""
    with changed(path := copy / mutant.place.file, mutant.place.changed(path.read_text("utf-8"))):
        for part in (tests[:FIRST], tests[FIRST:]):
            if part and not by:
                code, said = ended(PATIENCE * seconds, run_tests, copy, mutant.place.compiled, seconds, part)
                failed = FAILED.search(said)
                by = (
                    failed[1]
                    if failed
                    else ""
                    if code == 0
                    else "no end"
                    if code is None
                    else f"pytest ends with {code}"
                )
    return Verdict(mutant.place.key, by, len(tests), round(time.monotonic() - began, 1))


def each(copies: Sequence[Path], work: Callable[[Path, Any], Any], items: Sequence[Any]) -> Iterator[Any]:
    """Do something for every item, in as many copies at a time as there are; results come in order."""
    free: SimpleQueue[Path] = SimpleQueue()
    for copy in copies:
        free.put(copy)

    def done(item: Any) -> Any:
        copy = free.get()
        try:
            return work(copy, item)
        finally:
            free.put(copy)

    pool = ThreadPoolExecutor(len(copies))
    try:
        yield from pool.map(done, items)
    finally:
        pool.shutdown(cancel_futures=True)


def digest(files: Sequence[Path]) -> str:
    """A hash of what files hold."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(files))).hexdigest()[:12]


def measured(copies: Sequence[Path], folder: Path, tests: Sequence[Path], compiled: bool) -> list[Run]:
    """What files of tests run, known from before or run now."""
    source = [*(ROOT / "semgs").rglob("*.py"), *(one for one in (ROOT / "tests").rglob("*.py") if not one.name.startswith(("test_", "mutant")))]  # fmt: skip
    state = digest(source)

    def run(copy: Path, file: Path) -> Run:
        known = folder / "runs" / f"{file.stem}-{'compiled' if compiled else 'plain'}-{digest([file])}-{state}.json"
        if not known.exists():
            began = time.monotonic()
            code, said = ended(MEASURED, measure, copy, compiled, MEASURED, str(file.relative_to(ROOT)), known)
            if code != 0:
                print(f"{file.name}: not measured ({code})\n{said[-2000:]}", file=sys.stderr)
                return Run({}, {})
            print(f"{time.monotonic() - began:5.1f} s  {file.name}", *FAILED.findall(said), sep=", not ", flush=True)
        return Run(**json.loads(known.read_text("utf-8")))

    return list(each(copies, run, tests))


def compile_kernels(copy: Path) -> None:
    """Compile what every test would otherwise compile within its own time."""
    enter(copy, True, MEASURED)
    sys.path.insert(0, str(copy / "tests"))
    from kernels import compile_part

    for part in ("float32", "float64"):
        compile_part(part)
    sys.exit(0)


def main() -> int:
    """Try what is asked for and print a table; 1 if too few changes die."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*", help="parts of names of files; none is all")
    parser.add_argument("--list", action="store_true", help="show the changes, try none")
    parser.add_argument("--again", action="store_true", help="try survivors once more")
    parser.add_argument("--count", type=int, default=COUNT, help=f"how many changes to draw ({COUNT})")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (0)")
    parser.add_argument("--seconds", type=float, default=SECONDS, help=f"CPU time of a change's tests ({SECONDS:.0f})")
    parser.add_argument("--jobs", type=int, default=2, help="how many changes to try at a time (2)")
    parser.add_argument("--folder", type=Path, default=Path(".mutants"), help="results, which are not found again (.mutants)")  # fmt: skip
    asked = parser.parse_args()
    mutants = drawn(ROOT, asked.count, asked.seed)
    mutants = [one for one in mutants if not asked.words or any(word in one.place.file for word in asked.words)]
    if asked.list:
        print("\n".join(map(str, mutants)))
        return 0
    folder = asked.folder.resolve()

    def file_of(mutant: Mutant) -> Path:
        return folder / "verdicts" / f"{mutant.place.key}.json"

    def verdict_of(mutant: Mutant) -> Verdict | None:
        file = file_of(mutant)
        return Verdict(**json.loads(file.read_text("utf-8"))) if file.exists() else None

    verdicts = [verdict_of(one) for one in mutants]
    todo = [one for one, known in zip(mutants, verdicts, strict=True) if not known or (asked.again and not known.by)]
    if todo:
        os.environ |= {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
        forked.set_forkserver_preload(IMPORTED)
        copies = [copied(BUILD / str(job)) for job in range(asked.jobs)]
        list(each(copies, lambda copy, _: ended(MEASURED, compile_kernels, copy), copies))
        tests = sorted(path for package in PACKAGES for path in (ROOT / "tests" / package).rglob("test_*.py"))
        runs = {True: measured(copies, folder, tests, True)}
        with_kernels = {one.place.file.split("/")[1] for one in mutants if not one.place.compiled}
        runs[False] = measured(copies, folder, [one for one in tests if with_kernels & set(one.parts)], False)

        def work(copy: Path, mutant: Mutant) -> Verdict:
            found = chosen(mutant.place, runs[mutant.place.compiled], asked.seconds)
            verdict = tried(copy, mutant, found, 3 * asked.seconds)
            write(file_of(mutant), asdict(verdict))
            return verdict

        for mutant, verdict in zip(todo, each(copies, work, todo), strict=True):
            print(f"{verdict.seconds:5.1f} s  {mutant}: {verdict.by or 'SURVIVED'}", flush=True)
    return summary([(one, verdict) for one in mutants if (verdict := verdict_of(one))])


def summary(tried: Sequence[tuple[Mutant, Verdict]]) -> int:
    """Print survivors and counts; the exit code."""
    killed = sum(bool(verdict.by) for _, verdict in tried)
    survivors = [(mutant, verdict) for mutant, verdict in tried if not verdict.by]
    equivalent = [mutant for mutant, _ in survivors if mutant.equivalent]
    print()
    for mutant, verdict in tried:
        if mutant.equivalent and verdict.by:
            print(f"recorded as equivalent, but killed by {verdict.by}: {mutant}")
        elif not verdict.by and not mutant.equivalent:
            print(f"SURVIVED {verdict.tests} tests: {mutant}")
    minutes = sum(verdict.seconds for _, verdict in tried) / 60
    print(
        f"{len(tried)} changes: {killed} killed ({killed / max(1, len(tried)):.1%}), {len(equivalent)} equivalent, "
        f"{len(survivors) - len(equivalent)} survived; {minutes:.1f} minutes of one job"
    )
    return int(killed < TO_DIE * len(tried))


if __name__ == "__main__":
    sys.exit(main())
