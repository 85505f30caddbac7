"""Results: what was measured of each row, as JSON and back. No torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from semgs.files.errors import InputError
from semgs.files.strict_json import read_json

FORMAT = "semgs.bench"
VERSION = 1


@dataclass(frozen=True)
class Result:
    """What was measured of a row.

    Attributes:
        name: of the row.
        seconds: the least over the repeats; None if it could not be measured here.
        seconds_median: over the repeats.
        repeats: how many were measured, after those that warm up.
        gflop: floating-point operations, a product and its sum as two; None where they are not counted.
        gflop_per_second: in the least time.
        share_of_ceiling: the time that these operations would take at this machine's ceilings, over the least time.
        peak_memory_mb: of the whole process, or on the GPU [10^6 bytes]; None where it is not measured.
        reason: why there is no time; None if there is.
        details: what else is known of it: pairs of Gaussian and tile, frames per second.
    """

    name: str
    seconds: float | None
    seconds_median: float | None = None
    repeats: int = 0
    gflop: float | None = None
    gflop_per_second: float | None = None
    share_of_ceiling: float | None = None
    peak_memory_mb: float | None = None
    reason: str | None = None
    details: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Bench:
    """All that one run of the bench found.

    Attributes:
        machine: processor, cores, versions, and `ceilings`: GFLOP/s by name of their rows, of this run.
        results: one for each row that was asked for, in the order of the rows.
    """

    machine: Mapping[str, Any]
    results: tuple[Result, ...]

    @property
    def ceilings(self) -> Mapping[str, float]:
        """GFLOP/s of the ceilings of this run, by the names of their rows."""
        return self.machine.get("ceilings", {})

    @property
    def by_name(self) -> dict[str, Result]:
        """The results by the names of their rows."""
        return {result.name: result for result in self.results}


def numbers(bench: Bench) -> dict[str, Any]:
    """A bench, ready for JSON; what is not known is None."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "machine": dict(bench.machine),
        "results": [_entry(result) for result in bench.results],
    }


def is_bench(path: Path) -> bool:
    """Whether a file is JSON that says it is the bench's."""
    try:
        content = read_json(path)
    except InputError:
        return False
    return isinstance(content, dict) and content.get("format") == FORMAT


def read_bench(path: Path) -> Bench:
    """A bench from its file.

    Raises:
        InputError: the file cannot be read, or holds something else, or is of another version.
    """
    content = read_json(path, "the JSON file of semgs bench")
    if not isinstance(content, dict) or (content.get("format"), content.get("version")) != (FORMAT, VERSION):
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise InputError(path, f"a file of format {FORMAT}, version {VERSION}", f"{found!r:.60}", key="format")
    try:
        machine = content["machine"]
        ceilings = {str(name): float(value) for name, value in machine.get("ceilings", {}).items()}
        return Bench({**machine, "ceilings": ceilings}, tuple(_result(entry) for entry in content["results"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(path, "a whole file of semgs bench", f"{type(error).__name__}: {error}") from error


def _entry(result: Result) -> dict[str, Any]:
    """A result as JSON; the reason stands only where there is no time, details only where there are some."""
    fields: dict[str, Any] = {
        "name": result.name,
        "seconds": _rounded(result.seconds),
        "seconds_median": _rounded(result.seconds_median),
        "repeats": result.repeats,
        "gflop": _rounded(result.gflop),
        "gflop_per_second": _rounded(result.gflop_per_second),
        "share_of_ceiling": _rounded(result.share_of_ceiling),
        "peak_memory_mb": _rounded(result.peak_memory_mb),
    }
    if result.reason is not None:
        fields["reason"] = result.reason
    if result.details:
        fields["details"] = {name: _rounded(value) for name, value in result.details.items()}
    return fields


def _result(entry: dict[str, Any]) -> Result:
    """A result from JSON.

    Raises:
        KeyError, TypeError, ValueError: it was made by something else.
    """
    names = ("seconds", "seconds_median", "gflop", "gflop_per_second", "share_of_ceiling", "peak_memory_mb")
    reason = entry.get("reason")
    return Result(
        name=str(entry["name"]),
        repeats=int(entry["repeats"]),
        reason=None if reason is None else str(reason),
        details={str(name): float(value) for name, value in entry.get("details", {}).items()},
        **{name: None if entry[name] is None else float(entry[name]) for name in names},
    )


def _rounded(value: float | None) -> float | None:
    """A number to six significant digits."""
    return None if value is None else float(f"{value:.6g}")
