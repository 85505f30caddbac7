"""The commands of the workshop, called by name as those of semgs."""

from __future__ import annotations

from collections.abc import Sequence

from paper.ablate.__main__ import Ablate
from paper.bench.__main__ import Bench
from paper.figure.__main__ import PaperFigure
from paper.program import run
from semgs.cli.main import main as semgs

COMMANDS = {"ablate": Ablate, "bench": Bench, "figure": PaperFigure}


def main(words: Sequence[str]) -> int:
    """Run `python -m paper.NAME`, or else a command of semgs; returns its exit code."""
    name, *rest = words
    return run(COMMANDS[name], name, rest) if name in COMMANDS else semgs(words)
