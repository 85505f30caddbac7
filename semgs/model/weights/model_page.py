"""The page that the Hugging Face hub shows about weights: README.md with the hub's front matter, from the header of the weights file.

The front matter is YAML, of which JSON is a part (https://huggingface.co/docs/hub/model-cards). It states no data sets, because the hub means its own, and no licence unless the
header does.
"""

from __future__ import annotations

import json
from pathlib import Path

from semgs._version import __version__
from semgs.model.weights.header import Score
from semgs.model.weights.weights_file import count_parameters, read_header

LICENCES = ("apache-2.0", "mit", "cc0-1.0", "cc-by-4.0", "cc-by-sa-4.0", "cc-by-nc-4.0", "bsd-3-clause")
"""Licences that the hub knows, by its names; others are "other" there, with their own name beside it."""

PIPELINE = "image-to-3d"
"""The hub's name for what the network does."""

TAGS = ("gaussian-splatting", "semantic-segmentation", "depth-estimation", "3d-reconstruction")
"""What the hub's search finds the page by."""

LIMITS = """\
- Rooms only, a few metres wide, and nothing may move.
- Photos need poses. Wrong poses give wrong depth and classes.
- Two to four input views. Classes that are small or rare in the training data are often wrong.
"""


def page(path: str | Path, name: str) -> str:
    """The page about a weights file.

    Args:
        path: the file.
        name: "OWNER/NAME" of the repository, or of the folder if it has no owner yet.

    Raises:
        InputError: it is not a weights file of semgs, or its scores or terms are invalid.
    """
    header = read_header(path)
    where = name if "/" in name else f"OWNER/{name}"
    classes = "none: colour and depth only"
    if header.classes is not None:
        classes = f"{len(header.classes)} of the table {header.classes.name}: {', '.join(header.classes.names)}"
    lines = [
        *_front_matter(header.licence),
        f"# {name.rpartition('/')[2]}",
        "",
        f"Weights of the network `{header.settings.name}` of SemGS {__version__}: posed photos of a room become a semantic 3D scene of Gaussians, in one forward pass.",
        "",
        f"- **What they are**: {_said(header.description)}",
        f"- **Parameters**: {count_parameters(path):,}",
        f"- **Classes**: {classes}",
        f"- **Licence of the weights**: {_said(header.licence)}",
        "",
        "```python",
        "import semgs",
        "",
        f'model = semgs.SemGS.from_pretrained("{where}")',
        "```",
        "",
        f'`semgs.load("hf://{where}")` and `semgs reconstruct SCENE --out OUT --weights hf://{where}` read the same file.',
        "",
        "## Data",
        "",
        *([f"- {one.text}" for one in header.terms] or ["What the weights were trained on is not stated."]),
        "",
        "## Limits",
        "",
        LIMITS,
        *_scores(header.scores),
    ]
    return "\n".join(lines).rstrip() + "\n"


def _said(text: str | None) -> str:
    return "not stated" if text is None else text


def _front_matter(licence: str | None) -> list[str]:
    """The lines between the two rules, both included."""
    found: dict[str, object] = {"library_name": "semgs", "pipeline_tag": PIPELINE, "tags": list(TAGS)}
    if licence is not None:
        known = licence.lower() in LICENCES
        found["license"] = licence.lower() if known else "other"
        if not known:
            found["license_name"] = licence
    return ["---", *(f"{key}: {json.dumps(value)}" for key, value in found.items()), "---", ""]


def _scores(scores: tuple[Score, ...]) -> list[str]:
    """A table of the scores, with 95 % intervals."""
    if not scores:
        return ["No scores are stated."]
    rows = ["## Scores", "", "| data, input views | metric | value | 95 % interval |", "|---|---|---:|---:|"]
    for score in scores:
        for metric, figure in score.figures.items():
            between = "" if figure.low is None or figure.high is None else f"{figure.low:.3f} to {figure.high:.3f}"
            rows.append(f"| {score.data}, {score.views} | {metric} | {figure.value:.3f} | {between} |")
    return rows
