"""Labellers: the networks that labels are from, if no person made them."""

from __future__ import annotations

from dataclasses import dataclass

OPEN = frozenset(("apache-2.0", "mit", "isc", "bsd-2-clause", "bsd-3-clause", "cc0-1.0", "cc-by-4.0", "unlicense"))
"""Licences, as the Hugging Face hub names them, under which a network's answers may be used for anything."""

UNKNOWN = "unknown"
"""The licence of a network that states none."""


@dataclass(frozen=True)
class Labeller:
    """What made labels.

    Attributes:
        name: of the network; a file name or a hub id.
        licence: of the network.
    """

    name: str
    licence: str = UNKNOWN

    @property
    def title(self) -> str:
        """Name and licence."""
        return f"{self.name} (licence {self.licence})"

    @property
    def restricted(self) -> bool:
        """Whether its licence is stated, and not known to allow everything."""
        return self.licence.lower() not in {*OPEN, UNKNOWN}
