"""Rows: what is measured, as data; a row's name tells all of it. No torch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

Kind = Literal["network", "render", "train", "command"]
Precision = Literal["float32", "bfloat16"]

SIZE = (240, 320)
"""Height and width of the pictures [px]."""

THREADS = 2
"""Threads that compute."""

PRECISIONS: tuple[Precision, ...] = ("float32", "bfloat16")
NETWORKS = ("base", "small")
STAGES = ("cnn", "transformer_colour", "transformer_semantic", "cost_volume", "depth", "heads", "render")
"""Parts of a whole frame: those of the network, then one target drawn from its Gaussians."""

BATCH = 8
"""Scenes at once in the rows of batches."""


@dataclass(frozen=True)
class Row:
    """One thing that is measured.

    Attributes:
        name: to call it by; no two rows have the same.
        kind: what is run: encoding views and drawing one target (`network`), drawing a generated scene (`render`), a training
            step (`train`), the program itself (`command`).
        part: what of that: "total" or a stage, the passes, or the command.
        network: its name, empty where there is none.
        views: N.
        size: (height, width) of the pictures [px].
        threads: that compute.
        precision: of the layers.
        device: "cpu" or "cuda".
        batch: scenes at once.
        quick: whether `--quick` measures it too.
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
    quick: bool = False

    @property
    def run(self) -> Row:
        """What is run for it: the stages of a frame are measured with the frame. Rows of one run have this equal."""
        part = "total" if self.kind == "network" else self.part
        return replace(self, name="", part=part, quick=False)


def every_row() -> tuple[Row, ...]:
    """All rows there are, in the order of tables."""
    return tuple([*_frames(), *_stages(), *_others(), *_on_cuda()])


def chosen_rows(only: Sequence[str] = (), quick: bool = False) -> tuple[Row, ...]:
    """The rows to measure.

    Args:
        only: names; nothing else is measured then.
        quick: the rows of the quick look.

    Raises:
        KeyError: there is no row of a name; the name is its argument.
    """
    rows = every_row()
    if only:
        known = {row.name: row for row in rows}
        return tuple(known[name] for name in dict.fromkeys(only))
    return tuple(row for row in rows if row.quick or not quick)


def _frames() -> Iterator[Row]:
    """Whole frames."""
    for network in NETWORKS:
        for views in (2, 3, 4):
            for precision in PRECISIONS:
                quick = network == "small" and precision == "float32"
                name = f"total_{network}_n{views}_{precision}"
                yield Row(name, "network", "total", network, views, precision=precision, quick=quick)


def _stages() -> Iterator[Row]:
    """Where the time of a frame goes."""
    for network in NETWORKS:
        for stage in STAGES:
            yield Row(f"{stage}_{network}_n2", "network", stage, network, quick=network == "small")


def _others() -> Iterator[Row]:
    yield Row("render_n2", "render", "both", quick=True)
    yield Row("render_n2_colour", "render", "colour", quick=True)
    yield Row("render_n2_backward", "render", "backward", quick=True)
    yield Row("train_small_n2", "train", "step", "small")
    yield Row("command_small_n2", "command", "reconstruct", "small")
    yield Row("command_help", "command", "help", quick=True)


def _on_cuda() -> Iterator[Row]:
    """What a CUDA device adds: gsplat, and batches."""
    for row in _frames():
        yield replace(row, name=f"{row.name}_cuda", device="cuda", quick=False)
    for network in NETWORKS:
        for precision in PRECISIONS:
            name = f"total_{network}_n2_{precision}_b{BATCH}_cuda"
            yield Row(name, "network", "total", network, precision=precision, device="cuda", batch=BATCH)
    for row in _others():
        if row.kind in ("render", "train"):
            yield replace(row, name=f"{row.name}_cuda", device="cuda", quick=False)
