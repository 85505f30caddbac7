"""Memory plan: how much memory a scene needs, computed before it is encoded, and how many views to process at a time.

The memory of each stage is the sum in `semgs.model.memory.stage_memory`, plus libraries and a compiler (`LIBRARIES`, `COMPILER`) and the gaps between tensors
that the allocator cannot release (`HOLES`). Both were measured; docs/benchmarks.md says how, and docs/lab/memory.json compares the plan with real peaks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import torch

from semgs.model.layers.network_input import MULTIPLE, Chunks, padded_size
from semgs.model.memory.stage_memory import Work, seen_bytes, stage_bytes
from semgs.runtime.free_memory import free_bytes, held_bytes, kept_bytes
from semgs.runtime.kernels import has_computed

COMPILER, LIBRARIES = 90e6, 95e6
"""Memory of the compiler of the rendering kernels, and of the libraries for convolutions, which a process loads once [bytes]. A process keeps memory
that was freed, so the compiler comes on top of any stage. Only the first run compiles."""

HOLES = {"transformer_semantic": 0.2, "heads": 0.5, "cost_volume": 0.2, "render": 0.2}
"""The allocator's overhead relative to a stage's tensors, `MANY_HOLES` in the other stages: small tensors come from a heap, which keeps
gaps where tensors were freed; large tensors, as in the class networks, the cost volume and rendering, are released completely."""

MANY_HOLES, MOST_HOLES = 0.7, 250e6
"""The same overhead in stages of many layers, and its maximum [bytes]."""

ROUNDING = 1.04
"""Factor for small tensors that are not counted."""

JOINED = 64e6
"""On a CPU the heads process views together up to this input size [bytes]. Beyond it, two views together are no faster than one after
the other, and need more memory."""

SMALLEST_SIDE = 32


class NotEnoughMemoryError(MemoryError):
    """A scene needs more memory than there is; the message says what would fit."""


@dataclass(frozen=True)
class MemoryPlan:
    """How much memory encoding and rendering a scene will take.

    Attributes:
        peak_bytes: peak memory of the process, or on the network's CUDA device.
        stage: the stage of the peak: one of `semgs.model.memory.stage_memory.STAGES`, or `render`.
        chunks: views that the cost volume and the heads take at a time; the fastest choice if memory allows.
        short: whether memory is short, so that fewer views are taken at a time than would be fastest.
        available_bytes: memory that the process uses now plus what is free; infinite if unknown.
    """

    peak_bytes: float
    stage: str
    chunks: Chunks
    short: bool
    available_bytes: float


def memory_plan(work: Work, available_bytes: float | None = None) -> MemoryPlan:
    """The memory for encoding a scene and rendering its views, with the fastest chunks or, if memory is short, the largest that fit.

    Args:
        work: on views that are not padded yet.
        available_bytes: memory that may be used in total; None reads it from the system, its containers and limits, or the CUDA device.

    Raises:
        NotEnoughMemoryError: it does not fit even with one view at a time.
    """
    if available_bytes is None:
        available_bytes = _available(work.device)
    held, padded = _held(work.device), _resized(work, work.size)
    best = _fitting(padded, held, available_bytes)
    if best.peak_bytes > available_bytes:
        raise NotEnoughMemoryError(_too_much(padded, work.size, best, held))
    return best


def peaks(work: Work, chunks: Chunks, held: float) -> dict[str, float]:
    """Peak memory of a process in each stage, if it used `held` before, with libraries and compiler [bytes]."""

    def peak(stage: str, tensors: float) -> float:
        holes = min(HOLES.get(stage, MANY_HOLES) * tensors, MOST_HOLES)
        return held + ROUNDING * tensors + holes

    return {stage: peak(stage, tensors) for stage, tensors in stage_bytes(work, chunks).items()}


def _fitting(work: Work, held: float, available: float) -> MemoryPlan:
    """The plan with the fastest chunks, with the largest that fit, or with the smallest if none fit."""
    fastest = Chunks(heads=_joined(work))

    def largest(stages: tuple[str, ...], chunked: str) -> int | None:
        """The most views at a time with which those stages fit; None is all."""
        sizes = list(_halves(work.views, getattr(fastest, chunked)))
        for size in sizes:
            stage_peaks = peaks(work, Chunks(**{chunked: size}), held)
            if max(stage_peaks[stage] for stage in stages) <= available:
                return size
        return sizes[-1]

    chunks = Chunks(cost=largest(("cost_volume",), "cost"), heads=largest(("depth", "heads"), "heads"))
    stage_peaks = peaks(work, chunks, held)
    stage = max(stage_peaks, key=lambda name: stage_peaks[name])
    return MemoryPlan(stage_peaks[stage], stage, chunks, chunks != fastest, available)


def _joined(work: Work) -> int | None:
    """How many views the heads take at a time if memory is not short; None is all."""
    most = max(1, int(JOINED // seen_bytes(work)))
    return None if work.device.type != "cpu" or most >= work.views else most


def _halves(views: int, most: int | None) -> Iterator[int | None]:
    """The most views at a time, None being all of them, then half as many, and so on to one."""
    yield most
    views = most or views
    while views > 1:
        views = -(-views // 2)
        yield views


def _too_much(work: Work, size: tuple[int, int], best: MemoryPlan, held: float) -> str:
    """One line on the memory that is needed, the memory that is free, and what would fit."""
    line = (
        f"N = {work.views} at {size[0]}x{size[1]} needs about {_gigabytes(best.peak_bytes)}, "
        f"{_gigabytes(best.available_bytes)} are free"
    )
    for views in dict.fromkeys((work.views, 2)):
        for part in (1, 2, 4, 8):
            smaller = size if part == 1 else tuple(max(SMALLEST_SIDE, _rounded(side / part)) for side in size)
            less = _resized(replace(work, views=views, drawn=work.drawn - work.views + views), smaller)
            plan = _fitting(less, held, best.available_bytes)
            if plan.peak_bytes <= best.available_bytes:
                named = "" if views == work.views else f"N = {views} at "
                return f"{line}; {named}{smaller[0]}x{smaller[1]} needs {_gigabytes(plan.peak_bytes)}"
    return f"{line}; no size fits"


def _resized(work: Work, size: tuple[int, ...]) -> Work:
    """The same work on views of another (height, width), padded if necessary [px]."""
    padded = padded_size(size)
    return replace(work, size=padded, padded=padded != tuple(size))


def _rounded(side: float) -> int:
    """The nearest side that needs no padding."""
    return MULTIPLE * round(side / MULTIPLE)


def _gigabytes(count: float) -> str:
    """Bytes as text in gigabytes."""
    return f"{count / 1e9:.2g} GB"


def _held(device: torch.device) -> float:
    """Memory in use on the network's device, with what libraries and compiler will take, without what earlier scenes left for reuse."""
    if device.type == "cuda":
        return float(torch.cuda.memory_allocated(device)) + LIBRARIES + COMPILER
    if has_computed():
        return held_bytes() - kept_bytes() + COMPILER
    return held_bytes() + COMPILER + LIBRARIES


def _available(device: torch.device) -> float:
    """Memory that this process may use in total on the network's device."""
    if device.type == "cuda":
        free, _ = torch.cuda.mem_get_info(device)
        return float(free + torch.cuda.memory_reserved(device))
    return held_bytes() + free_bytes()
