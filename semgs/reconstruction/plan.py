"""Plan: how much memory a reconstruction will need, known before it begins, and how many views to work on at a time.

Each stage is a sum of what lies in memory together at its fullest moment, counted in numbers per feature texel, per Gaussian and per
pixel from the network's own settings; the terms say what they are. On top come what the compiled kernels bring when they are loaded,
and what the allocator cannot give back while holes are left between tensors: `LIBRARIES` and `HOLES`, which were measured
(docs/benchmarks.md says how, and how far the sum is from the peak of a process).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch

from semgs.data.views import Views
from semgs.model.chunks import WHOLE, Chunks
from semgs.model.cost_volume import CHUNK
from semgs.model.heads import RENDERED_HARMONICS
from semgs.model.semgs import MULTIPLE, SHRINK, SemGS
from semgs.reconstruction.memory import free_bytes, held_bytes

LIBRARIES = 178e6
"""What a process takes when it loads the compiled kernels and the libraries under its convolutions [bytes]."""

HOLES, MOST_HOLES = 0.7, 320e6
"""Share of its tensors that the allocator takes beyond them in a stage of many layers, and the most that it takes [bytes]: small
tensors come from a heap, which keeps the holes between those that are gone; large ones go back whole."""

FEW_HOLES = 0.2
"""The same share where a few large tensors are all: in the cost volume, and where views are drawn."""

ROUNDING = 1.04
"""Small tensors that are not counted."""

DRAWN_PAIRS = 30e6
"""The pairs of Gaussian and tile that are drawn together [bytes]."""

DRAWING = 340
"""What drawing a view takes for each Gaussian of the scene: its ellipse, its place in depth, its colour from there [bytes]."""

UNET_MAPS = 10
"""Maps of a U-Net's width that are in memory together at its finest level: skips, a convolution's input and output, both in
its own layout too."""

JOINED = 64e6
"""On a CPU the heads take views together while what they see of them is no more than this [bytes]: beyond it two views at a time
take as long as one after the other, and more memory."""

SMALLEST_SIDE = 32


class NotEnoughMemoryError(Exception):
    """A reconstruction that would need more memory than there is; the text says what would fit."""


@dataclass(frozen=True)
class Plan:
    """How a reconstruction will use memory.

    Attributes:
        peak_bytes: the most that will be held at any time: by the process, or on the network's CUDA device.
        stage: in which that is: one of `semgs.model.semgs.STAGES`, or `render`.
        chunks: how many views the cost volume and the heads take at a time; as many as is fastest where there is room.
        short: whether there is none, so that views come fewer at a time than is fastest.
        available_bytes: what the process holds now and what is free beside it, infinite where the system does not say.
    """

    peak_bytes: float
    stage: str
    chunks: Chunks
    short: bool
    available_bytes: float


@dataclass(frozen=True)
class Work:
    """What is to be done with a network.

    Attributes:
        views: that go in.
        size: (height, width) that they are padded to [px].
        drawn: views that are drawn of the Gaussians.
        padded: whether the padding copies the pictures.
    """

    views: int
    size: tuple[int, int]
    drawn: int
    padded: bool = False


def plan(model: SemGS, views: Views, targets: Views | None = None, *, available_bytes: float | None = None) -> Plan:
    """The memory that `reconstruct` will need, and the chunks that are fastest, or the largest with which it fits.

    Args:
        model: on the device that it will compute on.
        views: of one scene, that go in.
        targets: that are drawn beside them.
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


def stage_bytes(model: SemGS, work: Work, chunks: Chunks = WHOLE) -> dict[str, float]:
    """The tensors of each stage at its fullest moment [bytes], without what was held before."""
    number = max(next(model.parameters()).element_size(), 4)
    numbers = _numbers(model, work, chunks, next(model.parameters()).device.type == "cpu")
    count = work.views * _texels(work.size, model.stride)
    pixels = work.size[0] * work.size[1]
    classes = 0 if model.classes is None else len(model.classes)
    maps = 5 + classes
    # All views' renderings, the largest maps of one call to `render` once more while they are joined, the last view's layers.
    drawn = pixels * (work.drawn * maps + max(work.views, work.drawn - work.views) * max(classes, 3) + 2 * maps) * 4
    result = number * _result(model, count, work.views * pixels)
    drawing = result + drawn + DRAWING * count + DRAWN_PAIRS
    return {stage: number * value for stage, value in numbers.items()} | {"render": drawing}


def _numbers(model: SemGS, work: Work, chunks: Chunks, fused: bool) -> dict[str, float]:
    """How many numbers the tensors of each of the network's stages hold at its fullest moment."""
    s = model.settings
    views, classes = work.views, 0 if model.classes is None else len(model.classes)
    channels, candidates = s["channels"], s["candidates"]
    texels = views * _texels(work.size, SHRINK)
    tokens = texels / s["reduction"] ** 2
    gaussians = views * _texels(work.size, model.stride)
    pixels = views * work.size[0] * work.size[1]
    pictures = (3 * pixels if work.padded else 0) + (3 * gaussians if model.stride > 1 else 0)

    # Half-size maps of a residual block: its input, and two convolutions and their norms.
    cnn = 5 * s["cnn_widths"][0] * 4 * texels

    # Of the token maps either the hidden layer of the feed-forward network, before and after its activation, or keys and
    # values gathered from the other views.
    attention = tokens * channels * max(4 * s["expansion"] + 14, 3 * (views - 1) + 13)
    features = texels * channels
    # The pyramid's finest level, whose residual block is one of a U-Net; the features and the picture that go into it.
    pyramid = texels * (channels + 3 * SHRINK**2 + UNET_MAPS * channels) if s["semantic_pyramid"] else 0
    branches = 4 if classes else 2  # the shallow and the transformed features of each branch
    known = features * (branches + model.cosine_cost)

    # Features gathered for every pair of views, the sums and the counts of its planes; without the compiled kernel also
    # what is warped for some planes at a time, and where it is.
    at_once = min(chunks.cost or views, views)
    pair = 2 * channels + 2 * candidates
    if not fused:
        pair += CHUNK * (2 * channels + 10) + candidates
    cost = known + texels * (views - 1) * at_once / views * pair + texels * candidates

    known += 2 * texels * candidates + gaussians  # the cost, the distribution and its largest share
    regression = known + texels * (channels + 2 * candidates + UNET_MAPS * s["cost_width"])
    part = min(chunks.heads or views, views) / views
    harmonics = min(model.harmonics, RENDERED_HARMONICS)
    if model.paper_heads:
        depth = regression
        again = 0
        kept = known
        outputs = 7 + 3 * harmonics
    else:
        wide, projected, width = s["upsampled_channels"], s["projected_channels"], s["refine_width"]
        known += 2 * features + gaussians * (1 + (0 if chunks.heads else wide))
        refined = gaussians * (2 * projected + 5 + UNET_MAPS * width)
        depth = max(regression, known + refined)
        kept = known + gaussians * (width + 4)
        again = wide if chunks.heads else 0  # gone before the head begins
        outputs = 9 + 3 * harmonics
    # What the heads see, their hidden layer and their output, both in the convolution's own layout too.
    result = _result(model, gaussians, pixels)
    heads = kept + part * gaussians * (_seen(model) + max(again, 2 * s["colour_hidden"] + 2 * outputs))
    if part < 1:
        heads += result * (1 + part)
    return {
        "cnn": pictures + cnn,
        "transformer_colour": pictures + features + attention,
        "transformer_semantic": pictures + 3 * features + (max(attention, pyramid) if classes else 0),
        "cost_volume": pictures + cost,
        "depth": pictures + depth,
        "heads": pictures + heads,
    }


def _result(model: SemGS, gaussians: float, pixels: int) -> float:
    """How many numbers an encoding holds: its Gaussians, and two maps of its views."""
    harmonics = min(model.harmonics, RENDERED_HARMONICS)
    semantic = 0 if model.classes is None else 7 + len(model.classes)
    return gaussians * (3 + 1 + 7 + 3 * harmonics + semantic) + 2 * pixels


def peaks(model: SemGS, work: Work, chunks: Chunks, held: float) -> dict[str, float]:
    """The most that a process holds in each stage that held so much before [bytes]."""
    found = {}
    for stage, tensors in stage_bytes(model, work, chunks).items():
        share = FEW_HOLES if stage in ("cost_volume", "render") else HOLES
        found[stage] = held + LIBRARIES + ROUNDING * tensors + min(share * tensors, MOST_HOLES)
    return found


def _fitting(model: SemGS, work: Work, held: float, available: float) -> Plan:
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
    return Plan(found[stage], stage, chunks, chunks != fastest, available)


def _joined(model: SemGS, work: Work) -> int | None:
    """How many views the heads take at a time where memory is no matter; None is all."""
    parameter = next(model.parameters())
    seen = max(parameter.element_size(), 4) * _texels(work.size, model.stride) * _seen(model)
    most = max(1, int(JOINED // seen))
    return None if parameter.device.type != "cpu" or most >= work.views else most


def _halves(views: int, most: int | None) -> Iterator[int | None]:
    """The most views at a time, None being all of them, then half as many, and so on to one."""
    yield most
    views = most or views
    while views > 1:
        views = -(-views // 2)
        yield views


def _seen(model: SemGS) -> int:
    """Channels of what the heads of colour and opacity see."""
    s = model.settings
    return 3 + (s["channels"] + s["candidates"] if model.paper_heads else s["refine_width"] + s["upsampled_channels"])


def _too_much(model: SemGS, work: Work, size: tuple[int, int], best: Plan, held: float) -> str:
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


def _texels(size: tuple[int, int], stride: int) -> float:
    """Places of a view's grid with that stride."""
    return size[0] * size[1] / stride**2


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
