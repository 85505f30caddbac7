"""The header of a weights file: the network's settings and class table, and what its author wrote about it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from semgs.data.origin.terms import Terms, terms_from
from semgs.data.tables.classes import ClassTable
from semgs.files.errors import InputError, input_error
from semgs.files.records import make_record
from semgs.files.strict_json import parse_json
from semgs.model.settings import NetworkSettings
from semgs.rendering.temperatures import Temperatures

FORMAT = "2"
"""The version that is written and read."""

CHECKSUM = "tensors_sha256"
"""Key of the hash of all tensors (`checksum`); other files may have none."""

OWN_KEYS = frozenset({"semgs", "settings", "classes", CHECKSUM})
"""Keys of the header that the format itself uses."""

SCORES, TEMPERATURES, DATA_TERMS, SCENES = "scores", "temperatures", "data_terms", "scenes"
"""Keys with JSON: scores, temperatures, and the terms and the names of the scenes that the weights were trained on."""

LICENCE, DESCRIPTION = "licence", "description"
"""Keys with text: the licence of the weights, and where they come from."""

DIGITS = 3
"""Decimal places of a temperature in a header."""


@dataclass(frozen=True)
class Figure:
    """A measured number with its 95 % interval.

    Attributes:
        value: the number.
        low, high: ends of the interval; None without an interval.
    """

    value: float
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Score:
    """Scores of weights on some data.

    Attributes:
        data: name of the data.
        protocol: which frames were compared.
        views: number of input views.
        targets: number of views that were compared.
        sha256: of the file that was scored. The file with these scores in its header has the same tensors, but another header.
        figures: by the metric's name in `report.json`: miou, psnr [dB], ...
    """

    data: str
    protocol: str
    views: int
    targets: int
    sha256: str
    figures: Mapping[str, Figure]


@dataclass(frozen=True)
class Header:
    """The header of a weights file. What its author wrote is decoded on use: a mistake in the scores does not keep the network from loading.

    Attributes:
        path: of the file, for errors.
        settings: of the network.
        classes: its class table, None for a colour-only network.
        metadata: provenance: seed, data, steps, licence and anything else that its author wrote.
        checksum: the hash of all tensors; None if the header states none.
    """

    path: str | Path
    settings: NetworkSettings
    classes: ClassTable | None
    metadata: dict[str, str]
    checksum: str | None = None

    @classmethod
    def decoded(cls, path: str | Path, fields: Mapping[str, str]) -> Header:
        """From the text under each key.

        Raises:
            InputError: semgs did not write it, or wrote another version.
        """
        if fields.get("semgs") != FORMAT:
            raise InputError(path, f"weights of format {FORMAT}, written by semgs", "another header", key="metadata")
        try:
            settings = NetworkSettings.from_json(parse_json(fields["settings"]))
            classes = parse_json(fields["classes"])
            table = None if classes is None else make_record(ClassTable, classes)
        except (KeyError, ValueError) as error:
            raise InputError(path, "settings and a class table as JSON", f"{error}", key="metadata") from None
        rest = {key: text for key, text in fields.items() if key not in OWN_KEYS}
        return cls(path, settings, table, rest, fields.get(CHECKSUM))

    @property
    def description(self) -> str | None:
        """Where the weights come from; None if it is not stated."""
        return self.metadata.get(DESCRIPTION)

    @property
    def licence(self) -> str | None:
        """The licence of the weights; None if it is not stated."""
        return self.metadata.get(LICENCE)

    @property
    def scores(self) -> tuple[Score, ...]:
        """The scores of the weights; none if none are stated.

        Raises:
            InputError: they are invalid.
        """
        try:
            return tuple(make_record(Score, score) for score in parse_json(self.metadata.get(SCORES, "[]")))
        except (ValueError, TypeError) as error:
            raise InputError(self.path, "scores as JSON", f"{error}", key=SCORES) from None

    @property
    def temperatures(self) -> Temperatures | None:
        """The temperatures, which `semgs.rendering.temperatures` explains; None if none are stated.

        Raises:
            InputError: one is not a positive number.
        """
        if TEMPERATURES not in self.metadata:
            return None
        with input_error(self.path, "temperatures as JSON", key=TEMPERATURES):
            return make_record(Temperatures, parse_json(self.metadata[TEMPERATURES]))

    @property
    def terms(self) -> tuple[Terms, ...]:
        """The terms of the data that the weights were trained on; none if none are stated.

        Raises:
            InputError: they cannot be read.
        """
        try:
            return terms_from(self.metadata.get(DATA_TERMS, "[]"))
        except (ValueError, TypeError, KeyError) as error:
            found = f"{type(error).__name__}: {error}"
            raise InputError(self.path, "terms of data as JSON", found, key=DATA_TERMS) from error

    @property
    def scenes(self) -> tuple[str, ...]:
        """The names of the scenes that the weights were trained on; none if none are stated.

        Raises:
            InputError: they are no list of names.
        """
        with input_error(self.path, "names of scenes as JSON", key=SCENES):
            names = parse_json(self.metadata.get(SCENES, "[]"))
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise InputError(self.path, "a list of names", f"{names!r:.60}", key=SCENES)
        return tuple(names)


def format_fields(settings: NetworkSettings, classes: ClassTable | None, checksum: str) -> dict[str, str]:
    """What `Header.decoded` reads under the keys of the format, as text."""
    return {
        "semgs": FORMAT,
        "settings": json.dumps(settings.as_json()),
        "classes": json.dumps(None if classes is None else asdict(classes)),
        CHECKSUM: checksum,
    }


def scores_text(scores: Sequence[Score]) -> str:
    """Scores as text for a header."""
    return json.dumps([asdict(score) for score in scores])


def temperatures_text(temperatures: Temperatures) -> str:
    """Temperatures as text for a header."""
    return json.dumps({kind: round(value, DIGITS) for kind, value in asdict(temperatures).items()})
