"""Results: what was measured of each row, as JSON and back. No torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
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
        peak_memory_mb: of the whole process, or on the GPU [10^6 bytes]; None where it is not measured.
        reason: why there is no time; None if there is.
    """

    name: str
    seconds: float | None
    seconds_median: float | None = None
    repeats: int = 0
    peak_memory_mb: float | None = None
    reason: str | None = None


@dataclass(frozen=True)
class Bench:
    """All that one run of the bench found.

    Attributes:
        machine: processor, cores, versions.
        results: one for each row that was asked for, in the order of the rows.
    """

    machine: Mapping[str, Any]
    results: tuple[Result, ...]

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
        return Bench(dict(content["machine"]), tuple(_result(entry) for entry in content["results"]))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(path, "a whole file of semgs bench", f"{type(error).__name__}: {error}") from error


def _entry(result: Result) -> dict[str, Any]:
    """A result as JSON, numbers to six significant digits; without the reason if there is none."""
    fields = {
        name: float(f"{value:.6g}") if isinstance(value, float) else value for name, value in asdict(result).items()
    }
    return fields if result.reason is not None else {name: fields[name] for name in fields if name != "reason"}


def _result(entry: dict[str, Any]) -> Result:
    """A result from JSON; what older versions wrote beside it is passed over.

    Raises:
        KeyError, TypeError, ValueError: it was made by something else.
    """
    names = ("seconds", "seconds_median", "peak_memory_mb")
    reason = entry.get("reason")
    return Result(
        name=str(entry["name"]),
        repeats=int(entry["repeats"]),
        reason=None if reason is None else str(reason),
        **{name: None if entry[name] is None else float(entry[name]) for name in names},
    )
