"""Sources: where a training takes its scenes from, and in which proportion."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

ROOMS = "rooms"
"""The name of data that are drawn live."""


@dataclass(frozen=True)
class Source:
    """One of the things that a training takes its scenes from.

    Attributes:
        path: a scene or a folder of scenes; "rooms" for rooms drawn live.
        weight: its share of the samples, in relation to those of the others.
    """

    path: str
    weight: Fraction

    @classmethod
    def parsed(cls, text: str) -> Source:
        """Of "PATH=WEIGHT", or "PATH" for weight 1.

        Raises:
            ValueError: the weight is no positive number, or there is no path.
        """
        match = re.fullmatch(r"([^=].*?)(?:=([^=/]*))?", text)
        try:
            weight = Fraction(match[2] or "1" if match else "")
        except (ValueError, ZeroDivisionError):
            weight = Fraction(0)
        if match is None or weight <= 0:
            raise ValueError(f"data is {text!r}; expected {ROOMS}, DIR, or either with =WEIGHT, a positive number")
        return cls(match[1], weight)

    @property
    def is_rooms(self) -> bool:
        """Whether its scenes are rooms drawn live."""
        return self.path == ROOMS
