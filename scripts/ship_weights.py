"""Put a file of weights into the package: its header completed, the index of what ships written anew.

    python scripts/ship_weights.py runs/small/best.safetensors small --description "..." [--data-terms TEXT ...]

The scores of docs/scores, which must be of this very file (or of the one that its header's scores are of), go into its
header. The tensors stay as they are, to the bit. Without `--data-terms` the file's own terms stay.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from semgs.data.terms import Terms, terms_text
from semgs.evaluation.tables.card import scores_of
from semgs.evaluation.tables.report import read_report
from semgs.files.errors import InputError
from semgs.files.hashes import sha256
from semgs.weights.file import restate
from semgs.weights.index import shipped_folder, write_index
from semgs.weights.load import DATA_TERMS
from semgs.weights.scores import KEY, Score, read_scores, scores_text

SCORES = Path(__file__).resolve().parent.parent / "docs" / "scores"


def scores(weights: Path) -> list[Score]:
    """What the reports of docs/scores say of a file of weights.

    Raises:
        InputError: one of them is of other weights.
    """
    known = {sha256(weights), *(one.sha256 for one in read_scores(weights))}
    found: list[Score] = []
    for path in sorted(SCORES.glob("*.json")):
        report = read_report(path)
        if report.sha256 not in known:
            raise InputError(
                path, f"a report of {weights}", f"one of {report.sha256}", advice="evaluate again, or delete it"
            )
        found += scores_of(report)
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path)
    parser.add_argument("name")
    parser.add_argument("--description", required=True)
    parser.add_argument("--licence", default="Apache-2.0")
    parser.add_argument("--data-terms", nargs="+", default=None, metavar="TEXT")
    given = parser.parse_args()
    try:
        header = {"description": given.description, "licence": given.licence, KEY: scores_text(scores(given.weights))}
        if given.data_terms:
            header[DATA_TERMS] = terms_text(map(Terms, given.data_terms))
        restate(given.weights, shipped_folder() / f"{given.name}.safetensors", header)
    except InputError as error:
        sys.exit(str(error))
    write_index()
