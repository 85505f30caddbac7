"""Release tasks.

    python -m paper.release card                                             update docs/model_card.md from the reports in docs/scores
    python -m paper.release card --report "validation rooms" eval/report.json   first add a reduced report to docs/scores
    python -m paper.release ship runs/small/best.safetensors small --description "..."   add weights to the package
    python -m paper.release failures                                         update the failures in the model card
    python -m paper.release failures small --data SCENES --out look.jpg      show failures in other labelled scenes instead
    python -m paper.release confusions --report "single photos" eval/photos   update what fails in real photos, in the card, from reports
    python -m paper.release notice ROOMS/ATTRIBUTION.md [...] --photos FILE   update NOTICE for the rooms and photos that weights are trained on
    python -m paper.release demo OUT                                         update docs/images/demo.jpg from `semgs demo --out OUT`
    python -m paper.release audit                                            vulnerabilities, hashes, licences of what is installed
    python -m paper.release platforms                                        where every package of the base set has a wheel

For a release, run them in this order from the root.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from paper.release.audit import audit_release
from paper.release.card import write_card
from paper.release.confusions import write_confusions
from paper.release.demo import write_picture
from paper.release.failures import write_failures
from paper.release.notice import write_notice
from paper.release.platforms import check_platforms
from paper.release.ship import ship_weights
from semgs.files.errors import InputError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a task and return its exit code, 2 for bad input."""
    options = _parser().parse_args(arguments)
    try:
        return options.run(options) or 0
    except InputError as error:
        print(error, file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    """The tasks, their arguments, and what runs them; its result is the exit code, None for 0."""
    parser = argparse.ArgumentParser(
        prog="python -m paper.release", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    tasks = parser.add_subparsers(dest="task", required=True)
    card = tasks.add_parser("card")
    card.add_argument("--report", nargs=2, action="append", default=[], metavar=("TITLE", "REPORT.json"))
    card.set_defaults(run=lambda given: write_card({title: Path(path) for title, path in given.report}))
    ship = tasks.add_parser("ship")
    ship.add_argument("weights", type=Path)
    ship.add_argument("name")
    ship.add_argument("--description", required=True)
    ship.add_argument("--licence", default="Apache-2.0")
    ship.add_argument("--data-terms", nargs="+", default=(), metavar="TEXT")
    ship.set_defaults(run=_ship)
    failures = tasks.add_parser("failures")
    failures.add_argument("weights", nargs="?", default="small")
    failures.add_argument("--data", type=Path, metavar="DIR")
    failures.add_argument("--out", type=Path, metavar="FILE.jpg")
    failures.set_defaults(run=lambda given: print(write_failures(given.weights, given.data, given.out)))
    confusions = tasks.add_parser("confusions")
    confusions.add_argument("--report", nargs=2, action="append", required=True, metavar=("TITLE", "REPORT.json"))
    confusions.set_defaults(
        run=lambda given: print(write_confusions({title: Path(path) for title, path in given.report}))
    )
    notice = tasks.add_parser("notice")
    notice.add_argument("attributions", nargs="+", type=Path, metavar="ATTRIBUTION.md")
    notice.add_argument("--photos", required=True, type=Path, metavar="sources.json")
    notice.set_defaults(run=lambda given: write_notice(given.attributions, given.photos))
    tasks.add_parser("platforms").set_defaults(run=lambda given: check_platforms())
    audit = tasks.add_parser("audit")
    audit.add_argument("--lock", type=Path, default=Path("requirements.lock"), metavar="FILE")
    audit.set_defaults(run=lambda given: audit_release(given.lock))
    demo = tasks.add_parser("demo")
    demo.add_argument("demo", type=Path, metavar="OUT")
    demo.set_defaults(run=lambda given: write_picture(given.demo))
    return parser


def _ship(given: argparse.Namespace) -> None:
    header = {"description": given.description, "licence": given.licence}
    ship_weights(given.weights, given.name, header, given.data_terms)


if __name__ == "__main__":
    sys.exit(main())
