"""`semgs weights`: describes included weights or weights files; `verify` checks their hashes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from semgs.files.paths import typed_path
from semgs.run.options.words import positional
from semgs.run.usage_errors import what_the_user_gave

if TYPE_CHECKING:
    from semgs.evaluation.tables.table_grid import Grid

METRICS = ("miou", "accuracy", "psnr")
"""The scores that fit in a terminal."""


@dataclass(frozen=True)
class Weights:
    """List weights: name, hash, size, licence, parameters, terms of the training data, and scores.

    Examples
    - semgs weights
    - semgs weights runs/mine/weights.safetensors
    - semgs weights verify
    """

    weights: Annotated[tuple[str, ...], positional("[WEIGHTS ...]")] = ()
    """Names, files, or hf://OWNER/NAME on the hub; by default all included weights."""

    def run(self) -> None:
        """Print the tables.

        Raises:
            InputError: a file does not contain weights of semgs.
            UsageError: there are no included weights of that name.
        """
        from semgs.evaluation.tables.table_grid import printed
        from semgs.model.weights.index import read_index
        from semgs.model.weights.load import find

        with what_the_user_gave():
            files = {name: find(name)[1] for name in self.weights} or {one.name: one.path for one in read_index()}
        grids = [_files_grid(files), *_scores_grid(files)]
        print("\n\n".join(printed(grid, "text") for grid in grids))


@dataclass(frozen=True)
class Verify:
    """Check weights against the published SHA-256 hashes of this version.

    Use it on the included weights, or on files that you downloaded. The first mismatch ends with exit code 2.

    Examples
    - semgs weights verify
    - semgs weights verify small
    - semgs weights verify downloads/small.safetensors
    """

    weights: Annotated[tuple[str, ...], positional("[NAME or FILE ...]")] = ()
    """Names or files to check; by default all included weights."""

    def run(self) -> None:
        """Print which weights match.

        Raises:
            InputError: a file is missing or altered, or is none of the included weights.
        """
        from semgs.model.weights.index import SHOWN, check, matching, read_index

        index = {one.name: one for one in read_index()}
        for text in self.weights or index:
            if text in index:
                check(index[text])
            match = index.get(text) or matching(typed_path(text), tuple(index.values()))
            of = "" if match.name == text else f" of {match.name}"
            print(f"{text}: sha256 {match.sha256[:SHOWN]}{of} matches, {match.bytes:,} bytes")


def _files_grid(files: Mapping[str, Path]) -> Grid:
    """The table of files, with the terms of their training data below."""
    from semgs.evaluation.tables.table_grid import Cell, Grid
    from semgs.files.contents import sha256
    from semgs.model.weights.index import SHOWN
    from semgs.model.weights.load import data_terms
    from semgs.model.weights.weights_file import count_parameters, read_header

    rows, notes = [], []
    for name, path in files.items():
        metadata = read_header(path).metadata
        cells = (
            name, sha256(path)[:SHOWN], f"{path.stat().st_size / 1e6:.1f} MB", metadata.get("licence", "not stated"),
            f"{count_parameters(path):,}",
        )  # fmt: skip
        rows.append(tuple(map(Cell, cells)))
        notes.append(f"{name}: {metadata.get('description', 'no description')}")
        notes += [f"{name}, data: {one.text}" for one in data_terms(path)]
    head = ("weights", "sha256", "size", "licence", "parameters")
    return Grid("Weights", head, tuple(rows), notes=tuple(notes))


def _scores_grid(files: Mapping[str, Path]) -> list[Grid]:
    """The table of scores with intervals; none if no header has scores."""
    from semgs.evaluation.tables.table_grid import Cell, Grid, with_interval
    from semgs.model.weights.header import Figure
    from semgs.model.weights.weights_file import read_scores
    from semgs.objectives.measures import TITLES

    def cell(metric: str, figure: Figure | None) -> Cell:
        return Cell("–" if figure is None else with_interval(metric, figure.value, figure.low, figure.high))

    found = [(name, score) for name, path in files.items() for score in read_scores(path)]
    if not found:
        return []
    shown = [metric for metric in METRICS if any(metric in score.figures for _, score in found)]
    rows = tuple(
        (
            Cell(f"{name}, {score.data}, {score.views} views"),
            Cell(str(score.targets)),
            *(cell(metric, score.figures.get(metric)) for metric in shown),
        )
        for name, score in found
    )
    note = "In brackets 95 % intervals. Every kind of number: docs/evaluate.md."
    return [Grid("Scores", ("weights and data", "targets", *(TITLES[one] for one in shown)), rows, notes=(note,))]
