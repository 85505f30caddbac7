"""Put a file of weights into the package: its header completed, the index of what ships written anew."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from semgs.data.terms import Terms, terms_text
from semgs.evaluation.tables.card import figures
from semgs.evaluation.tables.evaluation_report import SavedReport, read_report
from semgs.files.errors import InputError
from semgs.files.hashes import sha256
from semgs.weights.file import restate
from semgs.weights.header_scores import KEY, Score, read_scores, scores_text
from semgs.weights.index import shipped_folder, write_index
from semgs.weights.load import DATA_TERMS
from tools.release.pages import SCORES


def ship(weights: Path, name: str, header: dict[str, str], data_terms: Sequence[str] = ()) -> None:
    """Ship weights. The tensors stay as they are, to the bit.

    Args:
        weights: a file.
        name: that they will have in the package.
        header: description and licence.
        data_terms: of the data that they were trained on; none keeps the file's own.

    Raises:
        InputError: the file cannot be used, or a report of docs/scores is of other weights.
    """
    terms = {DATA_TERMS: terms_text(map(Terms, data_terms))} if data_terms else {}
    scores = {KEY: scores_text(known_scores(weights, SCORES))}
    restate(weights, shipped_folder() / f"{name}.safetensors", {**header, **scores, **terms})
    write_index()


def known_scores(weights: Path, folder: Path) -> list[Score]:
    """What the reports of a folder say of a file of weights, or of the one that its header's scores are of.

    Raises:
        InputError: one of them is of other weights.
    """
    known = {*(one.sha256 for one in read_scores(weights)), sha256(weights)}
    found: list[Score] = []
    for path in sorted(folder.glob("*.json")):
        report = read_report(path)
        if report.sha256 not in known:
            raise InputError(
                path, f"a report of {weights}", f"one of {report.sha256}", advice="evaluate again, or delete it"
            )
        found += scores_of(report)
    return found


def scores_of(report: SavedReport) -> tuple[Score, ...]:
    """What a report says of weights, as their header has it.

    Raises:
        ValueError: it is not of weights.
    """
    if report.sha256 is None:
        raise ValueError(f"{report.path} is a report of predictions; expected one of weights")
    return tuple(
        Score(
            data=report.data_name,
            protocol=report.protocol,
            views=views,
            targets=int(result.numbers["samples"]),
            sha256=report.sha256,
            figures=figures(result.numbers),
        )
        for views, result in report.results.items()
    )
