"""The scores of a reconstruction, as the report and the terminal show them."""

from __future__ import annotations

from semgs.figures.html_page import Table
from semgs.objectives.measures import EXPLANATIONS, MEANINGS, MOSTLY_SEEN, TITLES, shown_number
from semgs.objectives.metrics import ViewScores, mean_scores
from semgs.run.steps.result import Reconstruction

DIGITS = 2
"""Digits after the point; more would mean little for a few views."""

ROLES = {"context": "input", "target": "held-out"}
"""What views of each role are called."""

SEEN = "_seen"
"""Suffix of measures over the seen pixels."""


def scores_lead(result: Reconstruction) -> str:
    """Explains the columns of the table."""
    return " ".join(f"{TITLES[name]}: {text}." for name, text in MEANINGS.items() if name in _measures(result))


def score_table(result: Reconstruction) -> Table:
    """All scores of all views, held out and input, and their means."""
    names = _measures(result)

    def cells(score: ViewScores) -> tuple[str, ...]:
        values = score.by_measure
        return tuple(shown_number(name, values.get(name), DIGITS) for name in names)

    rows = []
    for part in reversed(result.rendered_views):
        role = ROLES[part.role]
        for position, name, score in zip(part.positions, part.names, part.scores, strict=True):
            rows.append((f"{name} (frame {position}, {role})", *cells(score)))
        if len(part.scores) > 1:
            rows.append((f"mean, {role}", *cells(mean_scores(part.scores))))
    return Table(("view", *[TITLES[name] for name in names]), tuple(rows), _explained(names))


def refinement_table(result: Reconstruction) -> Table:
    """The mean scores of each role before and after refining."""
    assert result.refinement is not None
    names, rows = _measures(result), []
    for earlier, part in reversed(list(zip(result.refinement.before, result.rendered_views, strict=True))):
        for title, scores in (("one pass", earlier.scores), ("refined", part.scores)):
            values = mean_scores(scores).by_measure
            shown = (shown_number(name, values.get(name), DIGITS) for name in names)
            rows.append((f"{ROLES[part.role]} views, {title}", *shown))
    return Table(("", *[TITLES[name] for name in names]), tuple(rows), _explained(names))


def score_lines(result: Reconstruction) -> list[str]:
    """A line with mean scores for held-out views and for input views; another for the seen pixels if many were not seen."""
    lines = []
    for part in reversed(result.rendered_views):
        role, means = ROLES[part.role], mean_scores(part.scores)
        values = means.by_measure
        overall = [name for name in values if not name.endswith(SEEN) and name != "unseen"]
        lines.append(f"{role} views: {_listed(overall, values)}")
        if means.coverage < MOSTLY_SEEN:
            seen = [name for name in values if name.endswith(SEEN)]
            lines.append(f"{role} views, the {100 * means.coverage:.0f} % that is seen: {_listed(seen, values)}")
    for earlier in reversed(result.refinement.before if result.refinement else ()):
        lines.append(f"{ROLES[earlier.role]} views before refining: PSNR {mean_scores(earlier.scores).psnr:.2f} dB")
    return lines


def _measures(result: Reconstruction) -> list[str]:
    """The measures that some view has, in the order of tables."""
    known = {name for part in result.rendered_views for score in part.scores for name in score.by_measure}
    return [name for name in TITLES if name in known]


def _explained(names: list[str]) -> tuple[str, ...]:
    """What each column means, beginning with the one that has none."""
    return ("", *(EXPLANATIONS.get(name, "") for name in names))


def _listed(names: list[str], values: dict[str, float]) -> str:
    """Measures with their values."""
    return ", ".join(
        f"{TITLES[name]} {shown_number(name, values[name], DIGITS)}" + (" dB" if name.startswith("psnr") else "")
        for name in names
    )
