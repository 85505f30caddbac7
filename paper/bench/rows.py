"""The rows of the bench: what is measured. A row's name describes it completely. No torch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

Kind = Literal["network", "refine", "render", "train", "command"]
Precision = Literal["float32", "bf16"]

SIZE = (240, 320)
"""Height and width of the images [px]."""

THREADS = 2
"""Compute threads."""

PRECISIONS: tuple[Precision, ...] = ("float32", "bf16")
NETWORKS = ("base", "small")
STAGES = ("cnn", "transformer_colour", "transformer_semantic", "cost_volume", "depth", "heads", "render")
"""Parts of a frame: those of the network, then rendering one target."""

BATCH = 8
"""Batch size of the rows with batches."""

COMPETITORS = 8
"""Programs that compute at the same time in the rows of a busy machine."""


@dataclass(frozen=True)
class BenchRow:
    """One measurement.

    Attributes:
        name: unique.
        kind: what runs: encoding views and rendering one target (`network`), refining the Gaussians of views (`refine`), rendering a
            generated scene (`render`), a training step (`train`), the program itself (`command`).
        part: which part of that: "total" or a stage, the passes, or the command.
        network: its name; empty if none is used.
        views: number of input views.
        size: (height, width) of the images [px].
        threads: compute threads.
        precision: of the layers.
        device: "cpu" or "cuda".
        batch: batch size.
        beside: other processes that compute meanwhile.
        quick: whether `--quick` includes it.
    """

    name: str
    kind: Kind
    part: str
    network: str = ""
    views: int = 2
    size: tuple[int, int] = SIZE
    threads: int = THREADS
    precision: Precision = "float32"
    device: Literal["cpu", "cuda"] = "cpu"
    batch: int = 1
    beside: int = 0
    quick: bool = False

    @property
    def run(self) -> BenchRow:
        """The run that measures it; equal for rows that share a run. Stages of a frame are measured with the frame."""
        part = "total" if self.kind == "network" else self.part
        return replace(self, name="", part=part, quick=False)


def every_row() -> tuple[BenchRow, ...]:
    """All rows, in the order of tables."""
    return tuple([*_frames(), *_stages(), *_others(), *_on_cuda()])


def chosen_rows(only: Sequence[str] = (), quick: bool = False) -> tuple[BenchRow, ...]:
    """The rows to measure.

    Args:
        only: names of rows to measure; empty for all.
        quick: only the rows of `--quick`.

    Raises:
        KeyError: there is no row of a name; the name is its argument.
    """
    rows = every_row()
    if only:
        known = {row.name: row for row in rows}
        return tuple(known[name] for name in dict.fromkeys(only))
    return tuple(row for row in rows if row.quick or not quick)


def _frames() -> Iterator[BenchRow]:
    """Complete frames."""
    for network in NETWORKS:
        for views in (2, 3, 4):
            for precision in PRECISIONS:
                quick = network == "small" and precision == "float32"
                name = f"total_{network}_n{views}_{precision}"
                yield BenchRow(name, "network", "total", network, views, precision=precision, quick=quick)


def _stages() -> Iterator[BenchRow]:
    """The stages of a frame."""
    for network in NETWORKS:
        for stage in STAGES:
            yield BenchRow(f"{stage}_{network}_n2", "network", stage, network, quick=network == "small")


def _others() -> Iterator[BenchRow]:
    yield BenchRow("render_n2", "render", "both", quick=True)
    yield BenchRow("render_n2_colour", "render", "colour", quick=True)
    yield BenchRow("render_n2_backward", "render", "backward", quick=True)
    yield BenchRow("total_small_n2_busy", "network", "total", "small", beside=COMPETITORS)
    yield BenchRow("refine_small_n2", "refine", "passes", "small")
    yield BenchRow("train_small_n2", "train", "step", "small")
    yield BenchRow("command_small_n2", "command", "reconstruct", "small")
    yield BenchRow("command_help", "command", "help", quick=True)


def _on_cuda() -> Iterator[BenchRow]:
    """Rows on CUDA: gsplat, and batches."""
    for row in _frames():
        yield replace(row, name=f"{row.name}_cuda", device="cuda", quick=False)
    for network in NETWORKS:
        for precision in PRECISIONS:
            name = f"total_{network}_n2_{precision}_b{BATCH}_cuda"
            yield BenchRow(name, "network", "total", network, precision=precision, device="cuda", batch=BATCH)
    for row in _others():
        if row.kind in ("refine", "render", "train"):
            yield replace(row, name=f"{row.name}_cuda", device="cuda", quick=False)
