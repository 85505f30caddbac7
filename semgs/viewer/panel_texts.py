"""What the panel of the viewer says, as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from jaxtyping import UInt8

from semgs.figures.number_texts import length, percent
from semgs.files.images.colours import Colour
from semgs.files.text import printable
from semgs.viewer.pick import Hit
from semgs.viewer.splat_groups import Group

NOTHING = "Nothing was reconstructed here."

BOX = '<div style="padding: 0 0.9em 0.6em; font-size: 0.85em; line-height: 1.4">{}</div>'


def paragraph(text: str) -> str:
    """A paragraph of plain text."""
    return BOX.format(escape(printable(text)))


def legend_label(group: Group) -> str:
    """The name of a class, and how much of the scene it has if that is 1 % or more."""
    return printable(f"{group.name} {percent(group.share)}" if group.share >= 0.01 else group.name)


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


def hit_text(hit: Hit | None, metric: bool) -> str:
    """What a click met."""
    if hit is None:
        return paragraph(NOTHING)
    lines = [", ".join(length(side, metric) for side in hit.position)]
    if hit.name is not None and hit.probability is not None:
        lines.insert(0, hit_label(hit))
    return BOX.format("<br>".join(escape(printable(line)) for line in lines))


def hit_label(hit: Hit) -> str:
    """The class and its probability in one line; only the position of a scene without classes."""
    if hit.name is None or hit.probability is None:
        return "here"
    return f"{hit.name}, {percent(hit.probability)}"
