"""Add weights to the package: complete their header and update the index of included weights."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from paper.release.pages import SCORES
from semgs.data.origin.terms import Terms, terms_text
from semgs.evaluation.tables.card import figures
from semgs.evaluation.tables.saved_report import SavedReport, read_report
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.model.weights.header import DATA_TERMS, Score, scores_text
from semgs.model.weights.header import SCORES as KEY
from semgs.model.weights.index import read_index, shipped_folder, write_index
from semgs.model.weights.weights_file import read_scores, restate


def ship_weights(weights: Path, name: str, header: dict[str, str], data_terms: Sequence[str] = ()) -> None:
    """Add weights to the package. The tensors do not change.

    Args:
        weights: a file.
        name: of the weights in the package.
        header: description and licence.
        data_terms: of the training data; by default those in the file.

    Raises:
        InputError: the file cannot be used, or a report in docs/scores is of other weights.
    """
    terms = {DATA_TERMS: terms_text(map(Terms, data_terms))} if data_terms else {}
    scores = {KEY: scores_text(known_scores(weights, name, SCORES))}
    restate(weights, shipped_folder() / f"{name}.safetensors", {**header, **scores, **terms})
    write_index()


def known_scores(weights: Path, name: str, folder: Path) -> list[Score]:
    """Scores of weights from the reports of a folder. Reports of the file that the scores in the header refer to count too; those of other included weights do not.

    Raises:
        InputError: a report is of weights that are neither.
    """
    beside = [one for one in read_index() if one.name != name]
    others = {one.sha256 for one in beside} | {score.sha256 for one in beside for score in read_scores(one.path)}
    known = {*(score.sha256 for score in read_scores(weights)), sha256(weights)}
    scores: list[Score] = []
    for path in sorted(folder.glob("*.json")):
        report = read_report(path)
        if report.sha256 in others - known:
            continue
        if report.sha256 not in known:
            advice = "evaluate again, or delete it"
            raise InputError(path, f"a report of {weights}", f"one of {report.sha256}", advice=advice)
        scores += scores_of(report)
    return scores


def scores_of(report: SavedReport) -> tuple[Score, ...]:
    """The scores in a report, in the form of the header of weights.

    Raises:
        ValueError: the report is not of weights.
    """
    if report.sha256 is None:
        raise ValueError(f"{report.path} is a report of predictions; expected one of weights")
    shared: dict = {"data": report.data_name, "protocol": report.protocol, "sha256": report.sha256}
    results = [(views, result.numbers) for views, result in report.results.items()]
    return tuple(Score(views=v, targets=int(n["samples"]), figures=figures(n), **shared) for v, n in results)
