"""Write the tables of docs/model_card.md from the reports in docs/scores.

    python scripts/write_card.py                                                  the tables, from what is there
    python scripts/write_card.py --report "validation rooms" eval/val/report.json  keep a report there first, reduced

A report of that title is replaced; delete those that are of older weights. Afterwards `scripts/ship_weights.py` puts the same
scores into the header of the weights.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from semgs.evaluation.tables.card import reduced, tables, with_tables
from semgs.evaluation.tables.report import read_report
from semgs.files.atomic import write_json, write_text

DOCS = Path(__file__).resolve().parent.parent / "docs"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--report", nargs=2, action="append", default=[], metavar=("TITLE", "REPORT.json"))
    for title, path in parser.parse_args().report:
        read_report(path)  # refuses what is none
        (DOCS / "scores").mkdir(exist_ok=True)
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        write_json(DOCS / "scores" / f"{title.replace(' ', '_')}.json", reduced(content, title))
    card = DOCS / "model_card.md"
    write_text(card, with_tables(card.read_text(encoding="utf-8"), tables(DOCS / "scores")))
