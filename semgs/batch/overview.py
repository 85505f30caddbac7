"""Overview of a batch: OUT/index.html for the browser, and OUT/index.csv for pandas."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from urllib.parse import quote

from semgs._version import __version__
from semgs.batch.records import PICTURES, WRONG_CAMERAS, Record
from semgs.files.atomic import write_bytes, write_text
from semgs.files.text import printable

PAGE, TABLE = "index.html", "index.csv"

AT_ONCE = 100
"""Rows that a browser lays out at a time, so that thousands open at once."""

HEADINGS = {
    "psnr": "PSNR [dB]",
    "miou": "mIoU",
    "accuracy": "Accuracy",
    "depth_error": "Depth error",
    "gaussians": "Gaussians",
}
"""The headings of scores."""

FORMATS = {"psnr": "{:.1f}", "gaussians": "{:,.0f}"}
"""How scores are shown; others with three decimals."""


@dataclass(frozen=True)
class Scene:
    """A scene of a batch.

    Attributes:
        name: its name.
        record: what became of it; None if it was not run yet.
        result: file or folder to open, relative to the batch's folder; None if there is no result.
        picture: file of its picture, likewise.
    """

    name: str
    record: Record | None
    result: str | None
    picture: str | None

    @property
    def state(self) -> str:
        """ "done", "wrong cameras" (`semgs doctor`), "partly done" (`semgs export`), "failed" or "waiting"."""
        if self.record is None:
            return "waiting"
        if not self.record.succeeded:
            return "failed"
        if self.record.code != WRONG_CAMERAS:
            return "done"
        return "partly done" if self.record.why else "wrong cameras"

    @property
    def notes(self) -> str:
        """The error, or the notes."""
        return "" if self.record is None else self.record.why or " ".join(self.record.notes)


def scene_of(out: Path, name: str, result: str, record: Record | None) -> Scene:
    """A scene of a batch, with the files that it has.

    Args:
        out: the batch's folder.
        name: of the scene.
        result: what the command writes for it.
        record: what became of it.
    """
    if record is None or not record.succeeded or not (out / result).exists():
        return Scene(name, record, None, None)
    report, picture = f"{result}/report.html", f"{PICTURES}/{name}.jpg"
    opened = report if (out / report).is_file() else f"{result}/" if (out / result).is_dir() else result
    return Scene(name, record, opened, picture if (out / picture).is_file() else None)


def write_overview(out: Path, command: str, scenes: Sequence[Scene]) -> None:
    """Write the page and the table.

    Raises:
        OSError: they cannot be written.
    """
    scores = [name for name in HEADINGS if any(scene.record and name in scene.record.scores for scene in scenes)]
    write_text(out / PAGE, _page(command, scenes, scores))
    write_bytes(out / TABLE, _table(scenes, scores).encode(errors="backslashreplace"))


def _table(scenes: Sequence[Scene], scores: Sequence[str]) -> str:
    """The CSV: a row for each scene; unknown values are empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["scene", "state", *scores, "seconds", "result", "picture", "notes"])
    for scene in scenes:
        record = scene.record
        numbers = [record.scores.get(name, "") if record else "" for name in scores]
        seconds = record.seconds if record else ""
        writer.writerow(
            [scene.name, scene.state, *numbers, seconds, scene.result or "", scene.picture or "", scene.notes]
        )
    return text.getvalue()


def _page(command: str, scenes: Sequence[Scene], scores: Sequence[str]) -> str:
    """The page."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters |= {"url": _url, "printable": printable}
    template = files("semgs.batch").joinpath("templates/overview.html.j2").read_text(encoding="utf-8")
    states = [scene.state for scene in scenes]
    counts = {
        state: states.count(state)
        for state in ("done", "partly done", "wrong cameras", "failed", "waiting")
        if state in states
    }
    return environment.from_string(template).render(
        command=command, scenes=scenes, counts=counts, scores=scores, headings=HEADINGS, shown=_shown, table=TABLE, at_once=AT_ONCE, version=__version__,
    )  # fmt: skip


def _shown(name: str, value: float | None) -> str:
    """A score as text."""
    return "" if value is None else FORMATS.get(name, "{:.3f}").format(value)


def _url(path: str) -> str:
    """A path as a relative address."""
    return quote(path.encode(errors="surrogateescape"))
