"""Terms of use: the licences and agreements of data, and those of the networks that labels are from. Weights store the terms of what they were trained on."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass

from semgs.files.strict_json import parse_json

OPEN = frozenset(("apache-2.0", "mit", "isc", "bsd-2-clause", "bsd-3-clause", "cc0-1.0", "cc-by-4.0", "unlicense"))
"""Licences, as the Hugging Face hub names them, under which a network's answers may be used for anything."""

UNKNOWN = "unknown"
"""The licence of a network that states none."""


class TermsWarning(UserWarning):
    """Weights were trained on data with terms of use, which the warning quotes."""


@dataclass(frozen=True)
class Terms:
    """The terms of use of some data.

    Attributes:
        text: the data and its terms, in a few words.
        own: whether users of weights trained on the data should be warned.
    """

    text: str
    own: bool = False


ROOMS = Terms("CC0-1.0 rooms drawn by semgs")
FURNISHED = Terms("CC0-1.0 rooms drawn by semgs with third-party models and textures, see NOTICE")
SCANNET = Terms(
    "ScanNet: ScanNet Terms of Use, for non-commercial research and education, "
    "https://kaldir.vc.in.tum.de/scannet/ScanNet_TOS.pdf",
    own=True,
)
SCANNETPP = Terms(
    "ScanNet++: ScanNet++ Terms of Use, for non-commercial research and education, "
    "https://kaldir.vc.in.tum.de/scannetpp/static/scannetpp-terms-of-use.pdf",
    own=True,
)
REPLICA = Terms(
    "Replica: Replica Dataset Research Terms, for non-commercial research and education, "
    "https://github.com/facebookresearch/Replica-Dataset/blob/main/LICENSE",
    own=True,
)


def terms_text(terms: Iterable[Terms]) -> str:
    """Terms as text for a header: each once, in order."""
    return json.dumps([asdict(one) for one in dict.fromkeys(terms)])


def terms_from(text: str) -> tuple[Terms, ...]:
    """Terms from the text that `terms_text` wrote.

    Raises:
        ValueError, TypeError, KeyError: it is something else.
    """
    if not isinstance(text, str):
        raise TypeError(f"terms are {text!r:.40}; expected text")
    return tuple(Terms(str(one["text"]), bool(one["own"])) for one in parse_json(text))


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
