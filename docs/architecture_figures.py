"""Write the figures of docs/architecture.md: python docs/architecture_figures.py

Text is dark on filled boxes, and arrows are grey, so that they can be read on light and dark pages.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

IMAGES = Path(__file__).resolve().parent / "images"

STEP, DATA, INK, QUIET, ARROW = "#e4ecf7", "#fdecc8", "#1f2933", "#52606d", "#808890"
WIDTH, HEIGHT, GAP, PILL = 400, 62, 40, 24
"""Of a box [px]; of the space between two, and of what passes there."""
FONT, MONO = "DejaVu Sans, Verdana, sans-serif", "DejaVu Sans Mono, Menlo, monospace"


@dataclass(frozen=True)
class Step:
    """A step in a life.

    Attributes:
        title: what happens.
        text: in a few words more.
        modules: where, below `semgs`.
        result: what the next step gets; empty for the last one.
    """

    title: str
    text: str
    modules: str
    result: str = ""


SCENE = (
    Step("semgs reconstruct", "options; cameras of photos without poses", "run/reconstruct.py  sfm/", "SCENE"),
    Step("Open", "detect the layout; list frames, cameras, maps", "data/scenes.py  data/layouts/", "Scene"),
    Step("Choose", "views that overlap, near and far; check cameras", "data/choosing/  data/bounds/  doctor/", "Choice"),
    Step("Read", "crop and resize images, maps and cameras", "data/resampling.py", "Views"),
    Step("Encode", "plan memory, run the network", "model/encode.py  model/memory/", "Encoding"),
    Step("Place and segment", "depth, classes and features from elsewhere", "run/steps/  segmenters/", "Encoding"),
    Step("Refine", "with --refine: a few steps on the photos", "scene/photo_refinement.py", "Encoding"),
    Step("Render", "colour, classes and depth; scores", "rendering/  objectives/", "Reconstruction"),
    Step("Write", "scene, PLY, renders, report", "run/output/", "scene.safetensors"),
    Step("Use", "semgs view, render, export, query", "viewer/  export/  robotics/"),
)  # fmt: skip

NETWORK = (
    Step("Features", "a shallow CNN on each view", "model/layers/cnn.py", "features"),
    Step("Attention", "views look at one another, in each branch", "model/attention/", "features"),
    Step("Classes", "a backbone on the image; distributions", "model/classes/", "depth cue"),
    Step("Plane sweep", "cost volume, filtered; depth of each pixel", "model/sweep/", "depth"),
    Step("Gaussians", "attributes; placed along the pixel's ray", "model/gaussians/"),
)  # fmt: skip

WALK = (
    Step("Keyframes", "frames that show something new", "mapping/keyframes.py", "encoded windows"),
    Step("Merge", "windows that agree on depth", "mapping/merging.py"),
)

BATCH = (
    Step("semgs train", "settings, from options and presets", "cli/commands/networks/train.py", "TrainingSettings"),
    Step("Check the data", "scenes, classes, terms; RUN/data.json", "training/data/data_check/", "scenes"),
    Step("Sample", "input and target views of a scene or a new room", "training/data/samples.py  training/data/room_source.py", "Views"),
    Step("Augment", "crop, flip, roll, colour; cameras follow", "training/data/augmentation.py", "Views"),
    Step("Batch", "prepared ahead in worker processes", "training/data/batches.py", "Batch"),
    Step("Loss", "of rendered views, labels, images or depth", "training/supervision/", "gradient"),
    Step("Step", "clip, update the weights and their average", "training/state.py", "weights"),
    Step("Check and save", "validate the average; log, checkpoint", "training/loop.py  training/run/", "checkpoint"),
    Step("Weights", "averaged, with settings, classes and terms", "model/weights/", "weights.safetensors"),
    Step("Use", "semgs evaluate, reconstruct --weights", "evaluation/  run/"),
)  # fmt: skip

LOSS = (
    Step("Encode", "input views to Gaussians", "model/semgs.py", "Encoding"),
    Step("Render", "from the target views' cameras", "rendering/", "Rendering"),
    Step("Compare", "with images, labels and depth", "objectives/"),
)


def words(x: float, y: float, text: str, size: int, colour: str = INK, font: str = FONT, weight: str = "normal") -> str:
    """A line of text, centred."""
    return (
        f'<text x="{x:g}" y="{y:g}" font-size="{size}" fill="{colour}" font-family="{font}" font-weight="{weight}" '
        f'text-anchor="middle">{escape(text)}</text>'
    )


def arrow(start: tuple[float, float], end: tuple[float, float]) -> str:
    """A grey line with a head."""
    (x1, y1), (x2, y2) = start, end
    return f'<line x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}" stroke="{ARROW}" stroke-width="2" marker-end="url(#head)"/>'


def column(steps: tuple[Step, ...], left: float, top: float) -> list[str]:
    """Boxes one below the other, with what passes between them."""
    parts, middle = [], left + WIDTH / 2
    for number, step in enumerate(steps):
        y = top + number * (HEIGHT + GAP)
        parts += [
            f'<rect x="{left:g}" y="{y:g}" width="{WIDTH}" height="{HEIGHT}" rx="8" fill="{STEP}" stroke="{ARROW}"/>',
            words(middle, y + 18, step.title, 14, weight="bold"),
            words(middle, y + 35, step.text, 12, QUIET),
            words(middle, y + 53, step.modules.replace("  ", " · "), 12, font=MONO),
        ]
        if number + 1 < len(steps):
            parts.append(arrow((middle, y + HEIGHT), (middle, y + HEIGHT + GAP - 3)))
            width = 9 * len(step.result) + 16
            pill = y + HEIGHT + (GAP - PILL) / 2 - 2
            parts += [
                f'<rect x="{middle - width / 2:g}" y="{pill:g}" width="{width}" height="{PILL - 2}" rx="11" fill="{DATA}" stroke="{ARROW}"/>',
                words(middle, pill + 15, step.result, 12, font=MONO),
            ]
    return parts


def figure(title: str, main: tuple[Step, ...], beside: dict[str, tuple[tuple[Step, ...], int]]) -> str:
    """A life on the left; on the right what happens inside some steps, each with its caption and the step that it ends in."""
    left, right, top = 10, WIDTH + 110, 34
    height = top + 10 + len(main) * (HEIGHT + GAP) - GAP
    parts = column(main, left, top)
    for caption, (steps, end) in beside.items():
        start = top + (end + 1 - len(steps)) * (HEIGHT + GAP)
        parts += [words(right + WIDTH / 2, start - 10, caption, 13, ARROW), *column(steps, right, start)]
        row = top + end * (HEIGHT + GAP) + HEIGHT / 2
        parts.append(arrow((right, row), (left + WIDTH + 4, row)))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {right + WIDTH + 10} {height}" role="img">\n'
        f"<title>{title}</title>\n"
        f'<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0 L8 4 L0 8 z" fill="{ARROW}"/></marker></defs>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def figures() -> dict[str, str]:
    """The text of each figure by its file name."""
    return {
        "life_of_a_scene.svg": figure(
            "The life of a scene", SCENE, {"inside the network": (NETWORK, 4), "a whole walk (--all)": (WALK, 6)}
        ),
        "life_of_a_batch.svg": figure(
            "The life of a batch", BATCH, {"inside the loss, if views are rendered": (LOSS, 5)}
        ),
    }


if __name__ == "__main__":
    for name, text in figures().items():
        (IMAGES / name).write_text(text)
