"""Draw where weights fail, and say what they take for what: docs/images/failures.jpg and the part "Failures" of docs/model_card.md.

    python scripts/draw_failures.py                                                    of the weights that ship
    python scripts/draw_failures.py runs/mine/best.safetensors                         of others, into the same place
    python scripts/draw_failures.py small --data SCENES --out look.jpg                 in other labelled scenes; the card stays

Without --data the rooms are drawn here, from the seed of validation, in the world that nothing is trained in, without assets: anyone
may show them. The same weights give the same bytes on the same machine.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from semgs.cli.errors import UsageError, what_the_user_gave
from semgs.cli.progress import show_progress
from semgs.data.classes import SCANNET20
from semgs.data.scenes import open_scenes
from semgs.evaluation.frames.plan import make_plan
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.page.failures import BEGIN, END, Judged, judged, mistakes_table, sheet, worst
from semgs.evaluation.page.figure import Part
from semgs.evaluation.run import network_candidate
from semgs.evaluation.scoring.summary import summary
from semgs.evaluation.tables.card import between
from semgs.files.atomic import write_bytes, write_text
from semgs.files.errors import InputError
from semgs.rooms.dataset import Recipe, write_dataset
from semgs.training.settings import VALIDATION_SEED
from semgs.weights.index import SHOWN

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURE = DOCS / "images" / "failures.jpg"
CARD = DOCS / "model_card.md"

SCENES, SIZE, FRAMES, VIEWS = 16, (240, 320), 4, 2
"""Rooms that are drawn: with so many frames of this (height, width) [px]; each inner one is a target, from so many views."""
ROWS, MISTAKES, BYTES = 5, 8, 200_000
"""Targets on the picture, lines of the table, and the picture's largest size."""


def targets(weights: str, data: Path | None) -> tuple[tuple[Judged, ...], str]:
    """What weights say of all targets of some scenes, or of rooms that are drawn for it; and the hash of their file.

    Raises:
        InputError: the weights or scenes cannot be used.
        UsageError: no weights of that name ship.
    """
    with TemporaryDirectory() as drawn:
        if data is None:
            with show_progress("Drawing rooms", SCENES) as done:
                write_dataset(drawn, Recipe(VALIDATION_SEED, SIZE, FRAMES, "other"), SCENES, done=done)
        scenes = open_scenes(data or drawn)
        classes = next((scene.classes for scene in scenes if scene.classes), SCANNET20)
        plan = make_plan("neighbours", neighbours, scenes, [VIEWS])
        with what_the_user_gave():
            candidate = network_candidate(weights, classes, "cpu")
        with show_progress("Reconstructing", len(plan.tasks)) as done:
            found = judged(Part("", plan, (candidate.method,), classes).compare(done))
    if not found:
        raise InputError(data or drawn, "labelled scenes", "none with labels")
    return found, str(candidate.subject.sha256)


def told(found: tuple[Judged, ...], sha256: str) -> str:
    """What the card says of them, but for the picture."""
    scores = [one.scores for one in found]
    scenes = len({one.scene for one in scores})
    return (
        f"{len(found)} targets in {scenes} rooms, weights {sha256[:SHOWN]}: mIoU {summary(scores)['miou']:.3f}, "
        f"accuracy {summary(scores)['accuracy']:.3f}. The commonest mistakes:\n\n{mistakes_table(found, MISTAKES)}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", nargs="?", default="small")
    parser.add_argument("--data", type=Path, metavar="DIR")
    parser.add_argument("--out", type=Path, metavar="FILE.jpg")
    given = parser.parse_args()
    if (given.data is None) != (given.out is None):
        parser.error("--data and --out go together")
    try:
        found, sha256 = targets(given.weights, given.data)
        text = told(found, sha256)
        write_bytes(given.out or PICTURE, sheet(worst(found, ROWS), BYTES))
        if given.out is None:
            write_text(CARD, between(CARD.read_text(encoding="utf-8"), text, BEGIN, END))
    except (InputError, UsageError) as error:
        sys.exit(str(error))
    print(text)
