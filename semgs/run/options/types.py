"""Types of options that several commands share: each is checked as it is parsed, so a command gets only values it can use. No torch."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf, isinf
from typing import Annotated, Literal

from semgs.files.paths import found_at, typed_path
from semgs.model.networks import NAMES
from semgs.model.weights.hub import is_hub_id
from semgs.run.options.words import REPEATABLE, Words, one_word, optional, several
from semgs.run.usage_errors import UsageError
from semgs.viewer.access import host_name

SMALLEST_SIDE, LARGEST_SIDE = 32, 4096
"""Limits for the sides of images [px]."""

PROTOCOLS = ("neighbours", "peers", "pairs", "aside", "lsm [FILE]", "pinned FILE")
"""The protocols, as they are typed."""

DEVICES = ("auto", "cpu", "cuda")

Activated = Literal["auto", "yes", "no"]
ACTIVATED = {"auto": None, "yes": True, "no": False}
"""What it means to `load_splat`."""


def height_and_width(text: str) -> tuple[int, int]:
    """(height, width) of "240x320".

    Raises:
        ValueError: the text has another form.
    """
    match = re.fullmatch(r"(\d{1,6})[x×X](\d{1,6})", text)
    if not match:
        raise ValueError(f"expected height x width in pixels, such as 240x320, found {text!r}")
    return int(match[1]), int(match[2])


def shown_size(size: tuple[int, int] | None) -> str:
    """A size as it is typed; None is "auto"."""
    return "auto" if size is None else f"{size[0]}x{size[1]}"


def at_least(least: int | float, *, more: bool = False, finite: bool = False) -> Callable[[str], int | float]:
    """Reads a number that is not smaller than `least`, or with `more` one that is larger; a whole number if `least` is one, and with `finite` not infinity."""
    kind = type(least)
    sort = "a whole number, " if kind is int else "a finite number, " if finite else ""
    wanted = f"{sort}{f'more than {least:g}' if more else f'{least:g} or more'}"

    def read(text: str) -> int | float:
        with suppress(ValueError):
            value = kind(text)
            if (value > least or (value == least and not more)) and not (finite and isinf(value)):
                return value
        raise ValueError(f"expected {wanted}, found {text!r}")

    return read


def _size(text: str) -> tuple[int, int]:
    size = height_and_width(text)
    if not all(SMALLEST_SIDE <= side <= LARGEST_SIDE for side in size):
        raise ValueError(f"expected sides from {SMALLEST_SIDE} to {LARGEST_SIDE} pixels, found {text}")
    return size


def _device(text: str) -> str:
    if text == "mps":
        raise ValueError("mps is not supported yet: it has no float64, which cameras need; use cpu")
    if text not in DEVICES:
        raise ValueError(f"expected one of {', '.join(DEVICES)}, found {text!r}")
    return text


def _weights(text: str) -> str:
    if text not in NAMES and not is_hub_id(text) and (found := found_at(typed_path(text))) != "a file":
        raise UsageError(f"{text}: expected a file of weights, or small for the included weights, found {found}")
    return text


def _protocol(typed: Sequence[str]) -> tuple[str, ...]:
    name, *file = typed or ("",)
    if [*typed] == ["pinned"]:
        raise ValueError("expected a FILE after pinned, the frames.json or report.json of an evaluation, found none")
    if name not in [known.split()[0] for known in PROTOCOLS] or len(file) > (name in ("pinned", "lsm")):
        raise ValueError(f"expected one of {', '.join(PROTOCOLS)}, found {' '.join(typed)!r}")
    if file and not typed_path(file[0]).is_file():
        raise UsageError(f"{file[0]}: expected a list of frames, such as frames.json, found no such file")
    return tuple(typed)


def _passes(typed: Sequence[str]) -> int | float:
    return at_least(0)(typed[0]) if typed else -1


Size = Annotated[tuple[int, int], one_word("HxW", _size, shown_size)]
"""(height, width) of images [px]."""

AutoSize = Annotated[
    tuple[int, int] | None, one_word("HxW", lambda text: None if text == "auto" else _size(text), shown_size)
]
"""The same, or None for "auto": the command chooses."""

Device = Annotated[str, one_word("{auto, cpu, cuda}", _device)]
"""Where to compute: "auto", "cpu" or "cuda"; `chosen_device` decides."""

PrecisionOrAuto = Literal["auto", "float32", "bf16"]
"""Of the layers of a network; `chosen_precision` decides what "auto" is."""

Looks = Literal[1, 2]
"""How often a network looks at each photo for its classes (`SemGS.looks`)."""

Exposure = Literal["auto", "fitted", "as-taken"]
"""Whether photos come to a common exposure: if they clearly differ, always, or never. The `ExposureChoice` of `semgs.scene.exposure`, which imports torch."""

Weights = Annotated[str, one_word("WEIGHTS", _weights)]
"""Weights: a name of included ones, a file, or a hub id."""

WeightsOrRandom = Annotated[str | None, one_word("WEIGHTS", lambda text: text if text == "random" else _weights(text))]
"""The same, or "random"."""

Protocol = Annotated[
    tuple[str, ...],
    Words(count=(1, None), metavar="NAME [FILE]", read=_protocol),
]
"""("neighbours",), ("peers",), ("pairs",), ("aside",), ("lsm",), ("lsm", FILE), or ("pinned", FILE)."""

AllowedHosts = Annotated[tuple[Annotated[str, one_word("NAME", host_name)], ...], REPEATABLE, optional("NAME")]
SeveralWeights = Annotated[tuple[str, ...], several("W [W ...]", _weights)]

Views = Annotated[int, one_word("INT", at_least(2))]
"""A number of input views."""

SeveralCounts = Annotated[tuple[int, ...], several("N [N ...]", at_least(1))]
SeveralViews = Annotated[tuple[int, ...], several("N [N ...]", at_least(2))]

Count = Annotated[int, one_word("INT", at_least(1))]
"""How many: 1 or more."""

CountOrAuto = Annotated[int | None, one_word("N", at_least(1))]
"""The same; None lets the command decide."""

Workers = Annotated[int, one_word("INT", at_least(0))]
"""Worker processes; 0 for none."""

WorkersOrCores = Annotated[int | None, one_word("INT", at_least(0))]
"""The same; None for one per core."""


def _probability(text: str) -> float:
    with suppress(ValueError):
        value = float(text)
        if 0 <= value <= 1:
            return value
    raise ValueError(f"expected a number from 0 to 1, found {text!r}")


Probability = Annotated[float, one_word("FLOAT", _probability)]
"""A number from 0 to 1."""


def _near_far(typed: Sequence[str]) -> tuple[float, float]:
    with suppress(ValueError):
        near, far = map(float, typed)
        if 0 < near < far < inf:
            return near, far
    raise ValueError(f"expected near and far, 0 < near < far, found {' '.join(typed)!r}")


NearFar = Annotated[
    tuple[float, float] | None,
    Words(count=2, metavar="NEAR FAR", read=_near_far, shown=""),
]
"""The range of depths to look in, in the scene's unit; None to find it."""

Minutes = Annotated[float | None, one_word("FLOAT", at_least(0.0, more=True))]
"""More than 0; None for no limit."""


Passes = Annotated[
    int,
    Words(count=(0, 1), metavar="[PASSES]", read=_passes),
]
"""How often to pass over the photos: a number, 0 for never, or -1 for the default."""
