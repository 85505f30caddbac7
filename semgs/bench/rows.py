"""Rows: what is measured, as data; a row's name tells all of it. No torch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

Kind = Literal["ceiling", "network", "render", "train", "command"]
Precision = Literal["float32", "bfloat16"]

SIZE = (240, 320)
"""Height and width of the pictures where a name does not tell [px]."""

THREADS = 2
"""Threads where a name does not tell."""

OPERATIONS = ("conv", "matmul", "attention")
PRECISIONS: tuple[Precision, ...] = ("float32", "bfloat16")
NETWORKS = ("base", "small")
STAGES = ("cnn", "transformer_colour", "transformer_semantic", "cost_volume", "depth", "heads", "render")
"""Parts of a whole frame: those of the network, then one target drawn from its Gaussians."""

CURVE_SIZES = ((120, 160), (240, 320), (480, 640))
CURVE_VIEWS = (2, 3, 4, 5, 6, 7, 8)
CURVE_THREADS = (1, 2)
BATCH = 8
"""Scenes at once in the rows of batches."""


@dataclass(frozen=True)
class Row:
    """One thing that is measured.

    Attributes:
        name: to call it by; no two rows have the same.
        kind: what is run: an operation as fast as this machine can do it (`ceiling`), encoding views and drawing one target
            (`network`), drawing a generated scene (`render`), a training step (`train`), the program itself (`command`).
        part: what of that: the operation, "total" or a stage, the passes, or the command.
        network: its name, empty where there is none.
        views: N.
        size: (height, width) of the pictures [px].
        threads: that compute.
        precision: of the layers.
        device: "cpu" or "cuda".
        batch: scenes at once.
        quick: whether `--quick` measures it too.
        curve: whether it is for `--curves` alone.
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
    curve: bool = False

    @property
    def run(self) -> Row:
        """What is run for it: the stages of a frame are measured with the frame. Rows of one run have this equal."""
        part = "total" if self.kind == "network" else self.part
        return replace(self, name="", part=part, quick=False, curve=False)


def every_row() -> tuple[Row, ...]:
    """All rows there are, in the order of tables."""
    return tuple([*_ceilings("cpu"), *_frames(), *_stages(), *_others(), *_on_cuda(), *_curves()])


def chosen_rows(only: Sequence[str] = (), quick: bool = False, curves: bool = False) -> tuple[Row, ...]:
    """The rows to measure.

    Args:
        only: names; nothing else is measured then.
        quick: the rows of the quick look.
        curves: those that tell how cost grows, beside the usual ones.

    Raises:
        KeyError: there is no row of a name; the name is its argument.
    """
    rows = every_row()
    if only:
        known = {row.name: row for row in rows}
        return tuple(known[name] for name in dict.fromkeys(only))
    return tuple(row for row in rows if (row.quick if quick else curves or not row.curve))


def ceiling(operation: str, precision: str, threads: int = THREADS, device: str = "cpu") -> str:
    """The name of the row that says how fast this machine does an operation."""
    return f"ceiling_{operation}_{precision}" + (f"_t{threads}" if threads != THREADS else "") + _on(device)


def ceiling_row(operation: str, precision: Precision, threads: int = THREADS, device: str = "cpu") -> Row:
    """That row itself; those of other numbers of threads are measured where curves need them, and are in no table."""
    return Row(
        ceiling(operation, precision, threads, device),
        "ceiling",
        operation,
        threads=threads,
        precision=precision,
        device="cuda" if device == "cuda" else "cpu",
        quick=device == "cpu",
    )


def _ceilings(device: str) -> Iterator[Row]:
    for operation in OPERATIONS:
        for precision in PRECISIONS:
            yield ceiling_row(operation, precision, device=device)


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
    yield from _ceilings("cuda")
    for row in _frames():
        yield replace(row, name=row.name + _on("cuda"), device="cuda", quick=False)
    for network in NETWORKS:
        for precision in PRECISIONS:
            name = f"total_{network}_n2_{precision}_b{BATCH}{_on('cuda')}"
            yield Row(name, "network", "total", network, precision=precision, device="cuda", batch=BATCH)
    for row in _others():
        if row.kind in ("render", "train"):
            yield replace(row, name=row.name + _on("cuda"), device="cuda", quick=False)


def _curves() -> Iterator[Row]:
    """How cost grows with views, pixels and threads; what the usual rows hold already is left out."""
    for network in NETWORKS:
        for threads in CURVE_THREADS:
            for size in CURVE_SIZES:
                for views in CURVE_VIEWS:
                    usual = (size, threads) == (SIZE, THREADS)
                    if usual and views <= 4:
                        continue
                    name = f"total_{network}_n{views}_float32" + ("" if usual else f"_{size[0]}x{size[1]}_t{threads}")
                    yield Row(name, "network", "total", network, views, size, threads, curve=True)


def _on(device: str) -> str:
    """The end of a name on a device."""
    return "" if device == "cpu" else f"_{device}"
