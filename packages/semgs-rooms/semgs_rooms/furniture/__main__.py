"""`python -m semgs_rooms.furniture`: generate furniture from a seed, with Infinigen in an environment of its own."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from semgs.cli.main import run_command, run_guarded
from semgs.cli.progress import show_progress
from semgs.run.options.words import LAST_WORD, Words
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs_rooms.furniture.environment import default_folder, prepare
from semgs_rooms.furniture.generation import claim, generate

SHOWN = 5
"""How many of the excluded pieces are listed."""


@dataclass(frozen=True)
class Furniture:
    """Generate furniture for rooms from a seed, with Infinigen, as a folder for semgs rooms --assets.

    The furniture is beds, sofas, chairs, tables, desks, shelves, cabinets, refrigerators, stoves, toilets, baths, washbasins, doors,
    windows, curtains and kitchens. Incomplete pieces and pieces of unrealistic size are excluded. Piece i of a seed is always the
    same. To resume, repeat the command; a larger --pieces adds pieces.

    Infinigen (BSD-3) and Blender (GPL) run in an environment of their own, which is created once. It needs Python 3.11 and
    downloads about 600 MB from pip's package index. A piece takes 5 to 40 s on one core.

    OUT will contain:
    - models/: the pieces, .glb, about 0.1 MB each
    - catalog.json, textures.json: the catalogue
    - lock.json: hashes, which semgs rooms --assets DIR verifies
    - pieces/, bake.json: a record of all tries, to resume

    Examples
    - python -m semgs_rooms.furniture --out furniture --pieces 100
    - semgs rooms --out data/furnished --scenes 1000 --assets furniture
    - semgs rooms --out data/mixed --scenes 1000 --assets assets --assets furniture
    """

    out: Annotated[Path, Words(metavar="OUT"), LAST_WORD]
    """Output folder: new, empty, or one with the same seed to resume."""
    pieces: int = 100
    """Number of pieces to try. A few of a hundred are excluded."""
    seed: int = 0
    """Random seed. Different seeds give entirely different pieces."""
    workers: int = 1
    """Number of pieces generated in parallel. Each needs one core and about 1 GB of memory."""
    limit: float = 1200.0
    """Maximum time for one piece, in seconds. Pieces that take longer are tried again by the next call."""
    environment: Annotated[Path | None, Words(metavar="FOLDER")] = None
    """Folder of Infinigen's environment; by default in the user's cache."""
    python: Annotated[str | None, Words(metavar="PROGRAM")] = None
    """Python 3.11 to create the environment with; by default it is searched for."""

    def run(self) -> None:
        """Create the environment if it is missing, generate the pieces and print a summary."""
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
                settings: dict = {"environment": environment, "limit": self.limit, "workers": self.workers}
                made = generate(self.out, self.seed, self.pieces, done=done, **settings)
        except ImportError as error:
            raise UsageError(str(error)) from error
        self._report(made.rows, made.left_out | made.late)

    def _report(self, rows: tuple[dict, ...], left_out: dict[str, str]) -> None:
        """Print what was generated and what was excluded."""
        counts = Counter(row["class"] for row in rows)
        listed = ", ".join(f"{label} {count}" for label, count in counts.most_common())
        print(f"{self.out}: {len(rows)} pieces of seed {self.seed}" + (f" ({listed})" if rows else ""))
        if left_out:
            some = "; ".join(f"{name}: {reason}" for name, reason in list(left_out.items())[:SHOWN])
            more = f"; and {len(left_out) - SHOWN} more, see {self.out}/pieces" if len(left_out) > SHOWN else ""
            print(f"excluded {len(left_out)}: {some}{more}")
        if rows:
            print(f"to furnish rooms with them: semgs rooms --out OUT --assets {self.out}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the tool and return its exit code. Errors are printed as `semgs` prints them."""
    given = sys.argv[1:] if arguments is None else arguments
    return run_guarded(lambda: run_command(Furniture, "python -m semgs_rooms.furniture", given))


if __name__ == "__main__":
    sys.exit(main())
