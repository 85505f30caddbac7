"""Kills a command while it writes, checks its folder, and runs the same command again."""

from __future__ import annotations

import json
import shutil
import signal
from dataclasses import dataclass
from pathlib import Path

from faults.cases import Case, Tree, lay_inputs, tree, wrong
from faults.forked import CUT, STAGES, Moments, command, run
from semgs.files.atomic import is_part_of
from semgs.training.run.checkpoints import newest_checkpoint

SIZES = (0, 1, 100, 4096)
"""Bytes after which files are cut, in turns."""

ENDED = (-signal.SIGKILL, -signal.SIGXFSZ)


@dataclass(frozen=True)
class Kill:
    """A kill and what was wrong after it.

    Attributes:
        stage, number: the moment.
        resumed: whether the folder had content before.
        found: what was wrong; empty if nothing was.
    """

    stage: str
    number: int
    resumed: bool
    found: tuple[str, ...]


class Bench:
    """A folder with a command's inputs, the folder before it and after it; moments are counted once, from scratch and from before.

    Raises:
        RuntimeError: the command fails undisturbed.
    """

    def __init__(self, case: Case, folder: Path) -> None:
        self.case, self.folder = case, folder
        self.inputs, self.log = folder / "inputs", folder / "log.txt"
        self.inputs.mkdir(parents=True)
        if run(lambda: lay_inputs(self.inputs) or 0, self.log).code:
            raise RuntimeError(self.log.read_text())
        self.before = folder / "before"
        self._must(case.before(self.inputs, self.before))
        self.counts: dict[bool, dict[str, int]] = {}
        self.after: dict[bool, Tree] = {}
        self.results: dict[bool, Tree] = {}
        for resumed in (False, True):
            out = self._laid(resumed)
            counted = folder / "counts.json"

            def work(out: Path = out, counted: Path = counted) -> int:
                moments = Moments(out.parent)
                code = command(self.case.command(self.inputs, out))()
                text = json.dumps(moments.counts)
                counted.write_text(text)
                return code

            ended = run(work, self.log)
            if ended.code:
                raise RuntimeError(ended.output)
            self.counts[resumed] = json.loads(counted.read_text())
            self.after[resumed] = tree(out)
            self.results[resumed] = self._result(out)

    def _must(self, arguments: list[str]) -> None:
        ended = run(command(arguments), self.log)
        if ended.code:
            raise RuntimeError(f"{arguments} ended with {ended.code}:\n{ended.output}")

    def _laid(self, resumed: bool) -> Path:
        """A fresh output folder, in a folder of its own."""
        place = self.folder / "place"
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir()
        if resumed:
            shutil.copytree(self.before, place / "out")
        return place / "out"

    def _result(self, out: Path) -> Tree:
        """What all finished runs must agree in: the files that do not vary; of a training the newest checkpoint's tensors."""
        if self.case.name == "train":
            newest = newest_checkpoint(out / "checkpoints")
            return {} if newest is None else {name: one.numpy().tobytes() for name, one in newest.tensors.items()}
        return {name: data for name, data in tree(out).items() if not self.case.varies(name)}

    def kill(self, k: int, count: int) -> Kill:
        """Kill number `k` of `count`: moments are spread evenly, stages take turns, and every other folder is not new."""
        resumed, stage = bool(k // 3 % 2), STAGES[k % 3]
        number = int(self.counts[resumed][stage] * (k + 0.5) / count)
        out = self._laid(resumed)
        arguments = self.case.command(self.inputs, out)

        def work() -> int:
            Moments(out.parent, stage, number, SIZES[k // 6 % len(SIZES)] if stage == CUT else 0)
            return command(arguments)()

        ended = run(work, self.log)
        if ended.code not in ENDED:
            return Kill(stage, number, resumed, (f"not killed, but ended with {ended.code}: {ended.output[-500:]}",))
        before = tree(self.before) if resumed else {}
        found = wrong(self.case, before, tree(out), self.after[resumed])
        again = run(command(arguments), self.log)
        if again.code:
            found.append(f"the same command ended with {again.code}: {again.output[-500:]}")
        else:
            if self._result(out) != self.results[resumed]:
                found.append("the result is another")
            found += [
                f"{path.relative_to(out.parent)} stays behind"
                for pattern in (".*.part", ".*.lock")
                for path in out.parent.rglob(pattern)
                if not is_part_of(path, out / "settings.json")
            ]
        return Kill(stage, number, resumed, tuple(found))
