"""Targets: what was aimed at, and whether a bench meets it. No torch.

They are for two cores and 240x320, on a machine that does float32 convolutions at 450 GFLOP/s; a slower one is given more time
for whole frames and for drawing, in proportion.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from semgs.bench.results import Bench, Result
from semgs.bench.rows import ceiling

REFERENCE_GFLOPS = 450.0
"""Float32 convolutions of the machine that the targets are written for [GFLOP/s]."""

FASTER_IN_BFLOAT16 = 1.5
"""How much faster bfloat16 convolutions must be than float32 ones to say that a machine has hardware for them."""

NO_BFLOAT16 = "no bf16 hardware"

Quantity = Literal["seconds", "peak_memory_mb", "times"]


@dataclass(frozen=True)
class Target:
    """What a row should not exceed.

    Attributes:
        row: its name.
        limit: in seconds, 10^6 bytes, or times another row's seconds.
        quantity: which of these.
        scaled: whether a machine slower than the reference is given more.
        of: the other row, where the limit is a multiple.
    """

    row: str
    limit: float
    quantity: Quantity = "seconds"
    scaled: bool = False
    of: str = ""


TARGETS = (
    Target("total_base_n2_float32", 2.0, scaled=True),
    Target("total_base_n4_float32", 5.5, scaled=True),
    Target("total_base_n2_bfloat16", 1.2, scaled=True),
    Target("total_small_n2_float32", 0.118, scaled=True),
    Target("render_n2", 0.08, scaled=True),
    Target("render_n2_colour", 0.05, scaled=True),
    Target("render_n2_backward", 3.0, "times", of="render_n2"),
    Target("total_base_n2_float32", 1200.0, "peak_memory_mb"),
    Target("total_base_n4_float32", 2000.0, "peak_memory_mb"),
    Target("train_small_n2", 1.2),
    Target("command_small_n2", 4.0),
    Target("command_help", 0.4),
)


@dataclass(frozen=True)
class Verdict:
    """How a row stands to a target.

    Attributes:
        target: that was aimed at.
        limit: on this machine.
        measured: in the target's quantity; None where it could not be measured.
        met: whether it is met; None where nothing can be said.
        text: for a table.
    """

    target: Target
    limit: float
    measured: float | None
    met: bool | None
    text: str


def verdicts(bench: Bench) -> dict[str, list[Verdict]]:
    """The verdicts on the rows that have targets, by name of the row."""
    results = bench.by_name
    found: dict[str, list[Verdict]] = {}
    for target in TARGETS:
        if target.row in results:
            found.setdefault(target.row, []).append(_verdict(target, results, bench.ceilings))
    return found


def slowness(ceilings: Mapping[str, float]) -> float:
    """The factor on scaled targets: how much slower than the reference this machine's convolutions are, at least 1."""
    here = ceilings.get(ceiling("conv", "float32"))
    return max(1.0, REFERENCE_GFLOPS / here) if here else 1.0


def has_bfloat16(ceilings: Mapping[str, float], threads: int, device: str = "cpu") -> bool:
    """Whether bfloat16 convolutions are so much faster that there must be hardware for them."""
    half, single = (ceilings.get(ceiling("conv", name, threads, device)) for name in ("bfloat16", "float32"))
    return half is not None and single is not None and half >= FASTER_IN_BFLOAT16 * single


def _verdict(target: Target, results: Mapping[str, Result], ceilings: Mapping[str, float]) -> Verdict:
    """How one target stands."""
    result = results[target.row]
    limit = target.limit * (slowness(ceilings) if target.scaled else 1)
    measured = result.peak_memory_mb if target.quantity == "peak_memory_mb" else result.seconds
    if target.quantity == "times":
        other = results.get(target.of)
        comparable = measured is not None and other is not None and other.seconds
        measured = measured / other.seconds if comparable else None  # type: ignore[operator, union-attr]
    if measured is None:
        return Verdict(target, limit, None, None, result.reason or f"{_shown(limit, target)}: not measured")
    met = measured <= limit
    return Verdict(target, limit, measured, met, f"{_shown(limit, target)}: {'met' if met else 'missed'}")


def _shown(limit: float, target: Target) -> str:
    """A limit as text."""
    if target.quantity == "peak_memory_mb":
        return f"{limit:,.0f} MB"
    if target.quantity == "times":
        return f"{limit:g} x {target.of}"
    return f"{limit:.3g} s"
