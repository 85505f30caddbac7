"""The controls of `semgs view` and of pages in their order, and what both say. The page draws them with web/panel.js, the viewer with window.py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from types import MappingProxyType

import numpy as np
from jaxtyping import UInt8

from semgs.files.images.colours import Colour
from semgs.files.text import percent, printable
from semgs.robotics.objects import Objects
from semgs.viewer.pick import Hit
from semgs.viewer.splat_groups import Group, Mode

MODES: dict[Mode, str] = {
    "colour": "Colour", "classes": "Classes", "confidence": "Confidence", "depth": "Depth", "things": "Things",
}  # fmt: skip
"""Names of what splats show."""


@dataclass(frozen=True)
class Control:
    """A control of the panel.

    Attributes:
        key: what the code calls it.
        name: what users call it.
        help: what it does, in one sentence.
        on_pages: whether a page without a server has it, too.
    """

    key: str
    name: str
    help: str
    on_pages: bool = True


CONTROLS = (
    Control("show", "Show", "What the colours mean: they are those of the photos, or of the classes."),
    Control("overlay", "Overlay", "How strongly the class colours tint the photos' colours.", on_pages=False),
    Control("back", "Back to the photos", "Moves the camera to the nearest photo."),
    Control("photo", "Photo", "Moves the camera to this photo."),
    Control("near", "Stay where the photos saw", "Elsewhere, surfaces tear: photos show them from one side only."),
    Control("photos", "Show the photos", "Shows each photo where it was taken, unless it is in the way."),
    Control("boxes", "Show boxes of things", "A box around each thing, with its class and number."),
    Control("classes", "Classes", "Switch a class off to look behind it. Percentages are shares of all Gaussians."),
    Control("confidence", "Confidence", "Hides parts whose class is less certain than this, in percent."),
    Control(
        "clicked", "Clicked", "The class with its probability, and the position in the coordinates of your cameras."
    ),
    Control("render", "Render from here", "An image from this camera by SemGS's own renderer.", on_pages=False),
)
"""The controls of `semgs view` and of pages, in their order."""

WORDS = {
    "mouse": "Drag to turn, right-drag to move, scroll to zoom; or use the arrow keys and W A S D. Click to see what is there.",
    "touch": "One finger turns, two fingers move and zoom. Tap to see what is there.",
    "show_all": "Show all",
    "hide_all": "Hide all",
    "click": "Click on something to see what it is.",
    "nothing": "Nothing is shown here: no photo saw it, or its class is hidden.",
    "class": "Class",
    "thing": "Thing",
    "position": "Position",
    "here": "here",
}
"""What else the panel says."""

BOX = '<div style="padding: 0 0.9em 0.6em; font-size: 0.85em; line-height: 1.4">{}</div>'

STYLE = """<style>
.semgs-touch { display: none } @media (pointer: coarse) { .semgs-touch { display: inline } .semgs-mouse { display: none } }
.mantine-Flex-root:has(> div > p > label):has(.mantine-Checkbox-root) { flex-direction: row-reverse; justify-content: flex-end; gap: 0.6em }
.mantine-Flex-root:has(> div > p > label):has(.mantine-Checkbox-root) > div { display: flex; width: auto !important; flex-grow: 0 !important }
.mantine-Flex-root > div:has(> p > label:empty) { display: none }
@media (max-width: 640px) { .mantine-Paper-root:has(.mantine-ScrollArea-root), .mantine-ScrollArea-content > div { width: 100vw !important; max-width: none !important } }
</style>"""
"""For viser's panel: the hint that suits mouse or finger; a checkbox in front of its name; buttons that need no label have none; a
phone's panel is as wide as the phone."""


def controls_of(modes: Sequence[Mode], *, things: bool, on_page: bool) -> tuple[Control, ...]:
    """The controls of a scene, in their order.

    Args:
        modes: what can be shown.
        things: whether there are boxes.
        on_page: whether they are for a page without a server.
    """
    useless = set() if "classes" in modes else {"overlay", "classes", "confidence"}
    useless |= set() if things else {"boxes"}
    useless |= set() if len(modes) > 1 else {"show"}
    return tuple(one for one in CONTROLS if one.key not in useless and (one.on_pages or not on_page))


def thing_names(things: Objects) -> dict[int, str]:
    """The name of each thing by its number."""
    return {one.instance: f"{one.name} {one.instance}" for one in things.things}


def hint() -> str:
    """How to move, for the mouse or for fingers."""
    spans = "".join(f'<span class="semgs-{by}">{escape(WORDS[by])}</span>' for by in ("mouse", "touch"))
    return STYLE + BOX.format(spans)


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return BOX.format(escape(printable(text)))


def legend_label(group: Group) -> str:
    """The name of a class, and how much of the scene it has."""
    return printable(f"{group.name} {percent(group.share)}")


def legend_style(colours: Sequence[tuple[str, Colour]]) -> str:
    """A style sheet that gives checkboxes the colours of their classes.

    Args:
        colours: the id of each checkbox and the colour of its class.
    """
    rules = (
        f'[id="{box}"] {{ border: 2px solid rgb({red} {green} {blue}) !important; }} '
        f'[id="{box}"]:checked {{ background: rgb({red} {green} {blue}); }}'
        for box, (red, green, blue) in colours
    )
    return f"<style>{' '.join(rules)}</style>"


def scale_bar(palette: UInt8[np.ndarray, "n 3"], ticks: Sequence[str], label: str) -> str:
    """A colour bar with evenly spaced numbers and a label.

    Args:
        palette: from left to right.
        ticks: from left to right.
        label: below the bar.
    """
    stops = ", ".join(f"rgb({red} {green} {blue})" for red, green, blue in palette[:: len(palette) // 16].tolist())
    numbers = "".join(f"<span>{escape(tick)}</span>" for tick in ticks)
    return BOX.format(
        f'<div style="height: 0.8em; background: linear-gradient(to right, {stops})"></div>'
        f'<div style="display: flex; justify-content: space-between">{numbers}</div>{escape(label)}'
    )


def hit_text(hit: Hit | None, metric: bool, things: Mapping[int, str] = MappingProxyType({}), decimals: int = 2) -> str:
    """What a click met.

    Args:
        hit: what it met.
        metric: whether positions are in metres.
        things: the name of each thing by its number.
        decimals: digits after the point of positions, if they are not in metres.
    """
    if hit is None:
        return paragraph(WORDS["nothing"])
    rows = []
    if hit.name is not None:
        rows.append((WORDS["class"], hit_label(hit)))
    if hit.thing in things:
        rows.append((WORDS["thing"], things[hit.thing]))
    numbers = ", ".join(f"{side:.2f}" if metric else _shortest(side, decimals) for side in hit.position)
    rows.append((WORDS["position"], f"{numbers} m" if metric else numbers))
    return BOX.format("<br>".join(f"{name}: {escape(printable(text))}" for name, text in rows))


def _shortest(number: float, decimals: int) -> str:
    """A number with at most some digits after the point, as String(Number(number.toFixed(decimals))) in panel.js."""
    text = f"{number:z.{decimals}f}"
    return text.rstrip("0").rstrip(".") if decimals else text


def hit_label(hit: Hit) -> str:
    """The class and its probability in one line; for a scene without classes, that it is here."""
    if hit.name is None or hit.probability is None:
        return WORDS["here"]
    return f"{hit.name}, {percent(hit.probability)}"
