"""What each input view more is worth: differences to the fewest views of an evaluation, on the same targets.

    semgs evaluate small --data ROOMS --protocol neighbours --views 2 3 4 --out eval
    python scripts/more_views.py eval [OTHER_EVAL ...]

The contexts must be nested, as those of `neighbours` are: then nothing differs but the views that are added.
"""

from __future__ import annotations

import sys

from shared import markdown

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import paired_differences
from semgs.evaluation.tables.evaluation_report import SavedReport, read_report
from semgs.files.errors import InputError
from semgs.objectives.measures import TITLES

METRICS = ("psnr", "miou", "depth_abs_rel")


def table(report: SavedReport) -> str:
    """Each metric by number of views, and its paired difference to the fewest with a 95 % interval, as Markdown.

    Raises:
        ValueError: the contexts of more views do not begin with those of fewer, or the report lacks frames.
    """
    fewest, *more = sorted(report.results)
    base = report.results[fewest]
    rows = {name: [TITLES[name], f"{base.numbers[name]:.3f}"] for name in METRICS}
    for views in more:
        result = report.results[views]
        _check_nested(base.frames, result.frames)
        differences = paired_differences(base.frames, result.frames)
        for name in METRICS:
            change = differences[name]
            ends = f"{change.low:+.3f} to {change.high:+.3f}"
            rows[name].append(f"{result.numbers[name]:.3f}, {change.value:+.3f} ({ends})")
    title = f"{report.name} on {report.data_name}: {len(base.frames)} targets in {len(report.sizes)} scenes"
    head = ["", f"N = {fewest}", *[f"N = {views}, difference (95 %)" for views in more]]
    return f"{title}\n\n{markdown(head, rows.values())}"


def _check_nested(fewer: tuple[FrameScores, ...], more: tuple[FrameScores, ...]) -> None:
    """Refuse contexts that are others rather than more.

    Raises:
        ValueError: they are not nested.
    """
    for one, other in zip(fewer, more, strict=True):
        if not set(one.contexts) <= set(other.contexts):
            raise ValueError(f"the contexts of {one.scene}/{one.target} are not nested; expected --protocol neighbours")


if __name__ == "__main__":
    try:
        print("\n\n".join(table(read_report(path)) for path in sys.argv[1:]))
    except (InputError, ValueError) as error:
        sys.exit(f"error: {error}")
