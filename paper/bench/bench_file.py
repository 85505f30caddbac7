"""The JSON file of the bench: writing and reading it. No torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from semgs.files.errors import InputError
from semgs.files.strict_json import read_json

FORMAT = "semgs.bench"
VERSION = 1
OLDER_BF16 = "_bfloat16"
"""How older versions wrote bf16 in the names of rows."""


@dataclass(frozen=True)
class BenchResult:
    """The measurement of a row.

    Attributes:
        name: of the row.
        seconds: of the fastest repeat; None if it could not be measured.
        seconds_median: over the repeats.
        repeats: how many were measured, without warm-up runs.
        peak_memory_mb: of the process, or on the GPU [10^6 bytes]; None if not measured.
        reason: why there is no time; None if there is one.
    """

    name: str
    seconds: float | None
    seconds_median: float | None = None
    repeats: int = 0
    peak_memory_mb: float | None = None
    reason: str | None = None


@dataclass(frozen=True)
class BenchReport:
    """The results of one run of the bench.

    Attributes:
        machine: processor, cores, versions.
        results: one per row, in the order of the rows.
    """

    machine: Mapping[str, Any]
    results: tuple[BenchResult, ...]

    @property
    def by_name(self) -> dict[str, BenchResult]:
        """The results by the names of their rows."""
        return {result.name: result for result in self.results}


def numbers(bench: BenchReport) -> dict[str, Any]:
    """A bench, ready for JSON; unknown values are None."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "machine": dict(bench.machine),
        "results": [_entry(result) for result in bench.results],
    }


def read_bench(path: Path) -> BenchReport:
    """Read a bench from its file.

    Raises:
        InputError: the file cannot be read, contains something else, or has another version.
    """
    content = read_json(path, "the JSON file of a bench")
    if not isinstance(content, dict) or (content.get("format"), content.get("version")) != (FORMAT, VERSION):
        found = content.get("format") if isinstance(content, dict) else type(content).__name__
        raise InputError(path, f"a file of format {FORMAT}, version {VERSION}", f"{found!r:.60}", key="format")
    try:
        return BenchReport(dict(content["machine"]), tuple(_result(entry) for entry in content["results"]))
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
        raise InputError(path, "a complete file of a bench", f"{type(error).__name__}: {error}") from error


def _entry(result: BenchResult) -> dict[str, Any]:
    """A result as JSON, numbers to six significant digits; without the reason if there is none."""
    fields = {
        name: float(f"{value:.6g}") if isinstance(value, float) else value for name, value in asdict(result).items()
    }
    return fields if result.reason is not None else {name: fields[name] for name in fields if name != "reason"}


def _result(entry: dict[str, Any]) -> BenchResult:
    """A result from JSON; further keys, which older versions wrote, are ignored, and their names become those of now."""
    names = ("seconds", "seconds_median", "peak_memory_mb")
    reason = entry.get("reason")
    return BenchResult(
        name=str(entry["name"]).replace(OLDER_BF16, "_bf16"),
        repeats=int(entry["repeats"]),
        reason=None if reason is None else str(reason),
        **{name: None if entry[name] is None else float(entry[name]) for name in names},
    )
