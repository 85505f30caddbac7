"""`python -m tools.furniture`: a library of furniture from a seed, made with Infinigen in an environment of its own."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from semgs.cli.errors import UsageError, what_the_user_gave
from semgs.cli.main import carry_out, guarded
from semgs.cli.progress import show_progress
from tools.furniture.environment import default_folder, prepare
from tools.furniture.generation import claim, generate

SHOWN = 5
"""How many pieces that were left out are named."""


@dataclass(frozen=True)
class Furniture:
    """Make furniture for rooms from a seed, with Infinigen, as a folder that semgs rooms --assets takes.

    Beds, sofas, chairs, tables, desks, shelves, cabinets, refrigerators, stoves, toilets, baths, washbasins, doors, windows,
    curtains and kitchens, in fair shares. What comes out torn or in no real size is left out. Piece i of a seed is the same
    however many there are; the same command goes on where an interrupted one stopped, a larger --pieces adds.

    Infinigen (BSD-3) and Blender (GPL) run in an environment of their own, which is made once: it needs Python 3.11 and some
    600 MB from the package index that pip uses. A piece takes 5 to 40 s of one core.

    DIR becomes:
    - models/: the pieces, .glb, some 0.1 MB each
    - catalog.json, textures.json: what they are
    - lock.json: their hashes, by which semgs rooms --assets DIR notices what was altered
    - pieces/, bake.json: what was tried, for going on

    Examples
    - python -m tools.furniture furniture --pieces 100
    - semgs rooms data/furnished --scenes 1000 --assets furniture
    - semgs rooms data/mixed --scenes 1000 --assets assets --assets furniture
    """

    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]
    """Folder to write: a new one, an empty one, or one of the same seed to go on with."""
    pieces: int = 100
    """How many pieces to try; a few of a hundred are left out."""
    seed: int = 0
    """Of the stream of pieces; streams of different seeds have nothing in common."""
    workers: int = 1
    """Pieces that are made at once, each on a core of its own and in about 1 GB of memory."""
    limit: float = 1200.0
    """Longest that one piece may take [s]; what is not done by then is left for the next call."""
    environment: Annotated[Path | None, tyro.conf.arg(metavar="FOLDER")] = None
    """Where Infinigen's environment is or shall be; by default a folder in the user's cache."""
    python: Annotated[str | None, tyro.conf.arg(metavar="PROGRAM")] = None
    """Python 3.11 to make the environment with; by default one is looked for."""

    def run(self) -> None:
        """Make the environment if there is none, then the pieces, and say what there is.

        Raises:
            InputError: DIR or the environment's folder is of something else, or the environment cannot be made or does not work.
            UsageError: an option asks for what cannot be, or an extra that baking needs is not installed.
            OSError: the disk is full.
        """
        if self.limit <= 0 or self.workers < 1:
            raise UsageError(
                f"--limit is {self.limit:g} and --workers {self.workers}; expected a positive time and 1 or more"
            )
        with what_the_user_gave():
            claim(self.out, self.seed, self.pieces)
        environment = default_folder() if self.environment is None else self.environment
        prepare(environment, self.python, lambda line: print(line, flush=True))
        try:
            with show_progress("Generating pieces", self.pieces) as done:
                made = generate(
                    self.out, self.seed, self.pieces, environment=environment, limit=self.limit, workers=self.workers,
                    done=done,
                )  # fmt: skip
        except ImportError as error:
            raise UsageError(str(error)) from error
        self._report(made.rows, made.left_out | made.late)

    def _report(self, rows: tuple[dict, ...], left_out: dict[str, str]) -> None:
        """What there is, and what there is not."""
        counts = Counter(row["class"] for row in rows)
        listed = ", ".join(f"{label} {count}" for label, count in counts.most_common())
        print(f"{self.out}: {len(rows)} pieces of seed {self.seed}" + (f" ({listed})" if rows else ""))
        if left_out:
            some = "; ".join(f"{name}: {reason}" for name, reason in list(left_out.items())[:SHOWN])
            more = f"; and {len(left_out) - SHOWN} more, see {self.out}/pieces" if len(left_out) > SHOWN else ""
            print(f"left out {len(left_out)}: {some}{more}")
        if rows:
            print(f"furnish rooms with them: semgs rooms OUT --assets {self.out}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the tool and return its exit code; errors are told as `semgs` tells them."""
    given = sys.argv[1:] if arguments is None else arguments
    return guarded(lambda: carry_out(Furniture, "python -m tools.furniture", given))


if __name__ == "__main__":
    sys.exit(main())
