"""Memory plan: how much memory a scene will need, known before it is encoded, and how many views to work on at a time.

Each stage is the sum of `semgs.model.stage_memory`. On top come what the compiled kernels bring when they are loaded,
and what the allocator cannot give back while holes are left between tensors: `LIBRARIES` and `HOLES`, which were measured
(docs/benchmarks.md says how, and how far the sum is from the peak of a process).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch

from semgs.data.views import Views
from semgs.model.chunks import Chunks
from semgs.model.free_memory import free_bytes, held_bytes
from semgs.model.padded import MULTIPLE
from semgs.model.semgs import SemGS
from semgs.model.stage_memory import Work, seen_bytes, stage_bytes

LIBRARIES = 178e6
"""What a process takes when it loads the compiled kernels and the libraries under its convolutions [bytes]."""

HOLES, MOST_HOLES = 0.7, 320e6
"""Share of its tensors that the allocator takes beyond them in a stage of many layers, and the most that it takes [bytes]: small
tensors come from a heap, which keeps the holes between those that are gone; large ones go back whole."""

FEW_HOLES = 0.2
"""The same share where a few large tensors are all: in the cost volume, and where views are drawn."""

ROUNDING = 1.04
"""Small tensors that are not counted."""

JOINED = 64e6
"""On a CPU the heads take views together while what they see of them is no more than this [bytes]: beyond it two views at a time
take as long as one after the other, and more memory."""

SMALLEST_SIDE = 32


class NotEnoughMemoryError(MemoryError):
    """A scene that would need more memory than there is; the text says what would fit."""


@dataclass(frozen=True)
class MemoryPlan:
    """How encoding and drawing a scene will use memory.

    Attributes:
        peak_bytes: the most that will be held at any time: by the process, or on the network's CUDA device.
        stage: in which that is: one of `semgs.model.stages.STAGES`, or `render`.
        chunks: how many views the cost volume and the heads take at a time; as many as is fastest where there is room.
        short: whether there is none, so that views come fewer at a time than is fastest.
        available_bytes: what the process holds now and what is free beside it, infinite where the system does not say.
    """

    peak_bytes: float
    stage: str
    chunks: Chunks
    short: bool
    available_bytes: float


def memory_plan(
    model: SemGS, views: Views, targets: Views | None = None, *, available_bytes: float | None = None
) -> MemoryPlan:
    """The memory that encoding a scene and drawing its views will need, and the chunks that are fastest, or the largest with which it fits.

    Args:
        model: on the device that it will compute on.
        views: of one scene, that go in.
        targets: that are drawn beside them, as `semgs.reconstruction.reconstruct` does.
        available_bytes: what may be held altogether; None asks the system, its containers and limits, or the CUDA device.

    Raises:
        NotEnoughMemoryError: it does not fit, however few views are taken at a time.
    """
    device = next(model.parameters()).device
    if available_bytes is None:
        available_bytes = _available(device)
    held = _held(device)
    work = _work(len(views), views.size, 0 if targets is None else len(targets))
    best = _fitting(model, work, held, available_bytes)
    if best.peak_bytes > available_bytes:
        raise NotEnoughMemoryError(_too_much(model, work, views.size, best, held))
    return best


def peaks(model: SemGS, work: Work, chunks: Chunks, held: float) -> dict[str, float]:
    """The most that a process holds in each stage that held so much before [bytes]."""
    found = {}
    for stage, tensors in stage_bytes(model, work, chunks).items():
        share = FEW_HOLES if stage in ("cost_volume", "render") else HOLES
        found[stage] = held + LIBRARIES + ROUNDING * tensors + min(share * tensors, MOST_HOLES)
    return found


def _fitting(model: SemGS, work: Work, held: float, available: float) -> MemoryPlan:
    """The plan with the fastest chunks, the largest that fit, or the smallest where none do."""
    fastest = Chunks(heads=_joined(model, work))

    def largest(stages: tuple[str, ...], chunked: str) -> int | None:
        """The most views at a time with which those stages fit; None is all."""
        sizes = list(_halves(work.views, getattr(fastest, chunked)))
        for size in sizes:
            of = peaks(model, work, Chunks(**{chunked: size}), held)
            if max(of[stage] for stage in stages) <= available:
                return size
        return sizes[-1]

    chunks = Chunks(cost=largest(("cost_volume",), "cost"), heads=largest(("depth", "heads"), "heads"))
    found = peaks(model, work, chunks, held)
    stage = max(found, key=lambda name: found[name])
    return MemoryPlan(found[stage], stage, chunks, chunks != fastest, available)


def _joined(model: SemGS, work: Work) -> int | None:
    """How many views the heads take at a time where memory is no matter; None is all."""
    most = max(1, int(JOINED // seen_bytes(model, work)))
    return None if next(model.parameters()).device.type != "cpu" or most >= work.views else most


def _halves(views: int, most: int | None) -> Iterator[int | None]:
    """The most views at a time, None being all of them, then half as many, and so on to one."""
    yield most
    views = most or views
    while views > 1:
        views = -(-views // 2)
        yield views


def _too_much(model: SemGS, work: Work, size: tuple[int, int], best: MemoryPlan, held: float) -> str:
    """One line about what is needed, what there is, and what would fit."""
    line = (
        f"N = {work.views} at {size[0]}x{size[1]} needs about {_gigabytes(best.peak_bytes)}, "
        f"{_gigabytes(best.available_bytes)} are free"
    )
    for views in dict.fromkeys((work.views, 2)):
        for part in (1, 2, 4, 8):
            smaller = size if part == 1 else tuple(max(SMALLEST_SIDE, _rounded(side / part)) for side in size)
            found = _fitting(model, _work(views, smaller, work.drawn), held, best.available_bytes)
            if found.peak_bytes <= best.available_bytes:
                named = "" if views == work.views else f"N = {views} at "
                return f"{line}; {named}{smaller[0]}x{smaller[1]} needs {_gigabytes(found.peak_bytes)}"
    return f"{line}; no size fits"


def _work(views: int, size: tuple[int, ...], targets: int) -> Work:
    """What `reconstruct` does: all views are drawn, those that went in and the targets."""
    height, width = (-(-side // MULTIPLE) * MULTIPLE for side in size)
    return Work(views, (height, width), views + targets, (height, width) != tuple(size))


def _rounded(side: float) -> int:
    """The nearest side that needs no padding."""
    return MULTIPLE * round(side / MULTIPLE)


def _gigabytes(count: float) -> str:
    """Bytes as a reader wants them."""
    return f"{count / 1e9:.2g} GB"


def _held(device: torch.device) -> float:
    """What this process holds now where the network is."""
    return float(torch.cuda.memory_allocated(device)) if device.type == "cuda" else held_bytes()


def _available(device: torch.device) -> float:
    """What this process may hold altogether where the network is."""
    if device.type == "cuda":
        free, _ = torch.cuda.mem_get_info(device)
        return float(free + torch.cuda.memory_reserved(device))
    return held_bytes() + free_bytes()
