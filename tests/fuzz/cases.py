"""Cases of a format by their numbers, and what becomes of each.

Cases come in blocks of 500 that do not depend on each other: even numbers have damaged bytes from a seed, odd ones odd content by Hypothesis.
"""

from __future__ import annotations

import contextlib
import os
import random
import shutil
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from fuzz.format import Format
from fuzz.mutator import mutated
from fuzz.structures import Draw, edited
from fuzz.watch import SECRET, TooLong, Watch
from semgs.files.errors import InputError
from semgs.run.usage_errors import line_for

BLOCK = 500
Changes = dict[str, bytes | None]
"""New content of files by their names in the seed's folder; None for a file that is gone."""


class Enough(BaseException):
    """No more cases of this block are wanted; Hypothesis lets it pass."""


@dataclass
class Tally:
    """What became of some cases.

    Attributes:
        read, refused: how many were read, and how many refused with our error.
        found: what else happened: (case, what, where).
    """

    read: int = 0
    refused: int = 0
    found: list[tuple[int, str, str]] = field(default_factory=list)


class Bench:
    """A folder with the seed of a format, in which cases are laid out one after the other."""

    def __init__(self, form: Format, variant: int, folder: Path, watch: Watch) -> None:
        from PIL import Image

        self.form, self.watch = form, watch
        self.folder, self.out = folder / "case", folder / "out"
        for place in (self.folder, self.out, folder / "outside"):
            place.mkdir(parents=True)
        Image.new("RGB", (32, 24), (200, 100, 50)).save(folder / SECRET)
        self.root = form.variants[variant % len(form.variants)](self.folder)
        self.files = {
            str(path.relative_to(self.folder)): path.read_bytes()
            for path in sorted(self.folder.rglob("*"))
            if path.is_file()
        }
        self.main = [name for name in self.files if any(fnmatch(name, pattern) for pattern in form.main)]
        assert self.main, (form.name, sorted(self.files))

    def names(self, choose: random.Random) -> list[str]:
        """The files that a case changes: mostly one of the format's own, sometimes another or two."""
        first = choose.choice(self.main if choose.random() < 0.85 else list(self.files))
        return [first] if choose.random() < 0.9 else [first, choose.choice(list(self.files))]

    def by_bytes(self, choose: random.Random) -> Changes:
        """A case of damaged bytes."""
        if choose.random() < 0.02:
            return {choose.choice(list(self.files)): None}
        return {name: mutated(self.files[name], choose) for name in self.names(choose)}

    def by_structure(self, draw: Draw) -> Changes:
        """A case of odd content."""
        rest = draw(st.integers(0, 9)) == 0
        name = draw(st.sampled_from(list(self.files) if rest else self.main))
        return {name: edited(name, self.files[name], draw)}

    def run(self, changes: Changes) -> tuple[str, str, str]:
        """Lay out a case, read it and put the seed back: ("read" or "refused" or what is wrong, where, the last lines of the trace)."""
        for name, data in changes.items():
            path = self.folder / name
            path.unlink()
            if data is not None:
                path.write_bytes(data)
        try:
            return self._outcome(tuple(changes))
        finally:
            for name in changes:
                (self.folder / name).write_bytes(self.files[name])
            for place in self.out.iterdir():
                shutil.rmtree(place) if place.is_dir() and not place.is_symlink() else place.unlink()

    def _outcome(self, changed: tuple[str, ...]) -> tuple[str, str, str]:
        told, where = "read", ""
        try:
            with self.watch.case() as seen, warnings.catch_warnings():
                warnings.simplefilter("ignore")
                self.form.read(self.root, self.out, changed)
        except InputError as error:
            told = "refused"
            if "\n" in str(error) or not any(str(place) in str(error.path.absolute()) for place in self._places()):
                told, where = "a message that does not name the file", str(error)
        except MemoryError as error:
            told, where = "more than 1 GB", trace(error)
        except (Exception, TooLong, SystemExit, RecursionError) as error:
            line = line_for(error) if isinstance(error, Exception) else None
            if line is not None and not isinstance(error, RuntimeError):
                told = "refused"
            else:
                told, where = f"{type(error).__name__}: {error}"[:300], trace(error)
        if seen and (self.form.sealed or not all(one.startswith("reads ") for one in seen)):
            told, where = "; ".join(dict.fromkeys(seen))[:400], told
        return told, where, ""

    def _places(self) -> tuple[Path, ...]:
        return (self.folder.parent,)


def trace(error: BaseException) -> str:
    """Where an error came from: the last places in our code and behind it."""
    frames = traceback.extract_tb(error.__traceback__)
    return " < ".join(f"{Path(one.filename).name}:{one.lineno} {one.name}" for one in frames[-6:][::-1])


def cases(
    bench: Bench, base: int, block: int, wanted: Callable[[int], bool], count: int
) -> Iterator[tuple[int, Changes]]:
    """The wanted cases among the first `count` of a block, bytes first, then structures; a generator cannot be had from Hypothesis for these."""
    for number in range(0, count, 2):
        case = block * BLOCK + number
        if wanted(case):
            yield case, bench.by_bytes(random.Random(f"{base} {bench.form.name} {case}"))


def run_block(
    bench: Bench, base: int, block: int, count: int, wanted: Callable[[int], bool], begin: Callable[[int], None]
) -> Tally:
    """Run the wanted cases among the first `count` of a block.

    Args:
        bench: of the format.
        base: the seed.
        block: its number.
        count: of its cases.
        wanted: whether to run a case.
        begin: called with the number of each case before it runs.
    """
    tally = Tally()

    def one(case: int, changes: Changes) -> None:
        begin(case)
        told, where, _ = bench.run(changes)
        if told == "read":
            tally.read += 1
        elif told == "refused":
            tally.refused += 1
        else:
            tally.found.append((case, told, where))

    for case, changes in cases(bench, base, block, wanted, count):
        one(case, changes)
    odd = iter(range(1, count, 2))

    @seed(f"{base} {bench.form.name} {block}")
    @settings(
        max_examples=BLOCK // 2 + 1,
        database=None,
        deadline=None,
        phases=(Phase.generate,),
        suppress_health_check=list(HealthCheck),
    )
    @given(st.data())
    def structures(data: st.DataObject) -> None:
        changes = bench.by_structure(data.draw)  # first, as Hypothesis wants the same draws whatever comes after them
        number = next(odd, None)
        if number is None:
            raise Enough
        case = block * BLOCK + number
        if wanted(case):
            one(case, changes)

    with contextlib.suppress(Enough):
        structures()
    return tally


def own_limits(folder: Path) -> None:
    """What a process of cases has for itself: one thread, no core files, a folder for temporary files and no home."""
    import resource

    import cv2
    import torch

    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name in ("TMPDIR", "HOME", "XDG_CACHE_HOME"):
        os.environ[name] = str(folder)
