"""The NOTICE of weights that were trained in rooms with assets: the works whose licences ask for attribution."""

from __future__ import annotations

import re
from collections.abc import Sequence

ASKS = "CC-BY"
"""How the licences begin that ask for attribution wherever the work goes."""

HEAD = """\
SemGS
Apache-2.0, see LICENSE.

Rooms that the weights of SemGS are trained in show models and textures by others. Those under licences that ask for attribution (CC-BY) are
named here: the file in the folder of assets, the repository that it is from at a commit, and its path there. The others are CC0, in
the public domain, ours, Apache-2.0, MIT or BSD-3-Clause; `semgs rooms --assets` writes the list of all (ATTRIBUTION.md) beside the rooms that it draws.
"""


def notice(attributions: Sequence[str]) -> str:
    """The text of NOTICE.

    Args:
        attributions: texts of `ATTRIBUTION.md`, as `semgs.rooms.assets.lock.attribution` gives them; a work in several is named once.

    Raises:
        ValueError: one of them is not of that form, or names no work.
    """
    groups: dict[str, set[str]] = {}
    for text in attributions:
        for licence, works in _groups(text).items():
            groups.setdefault(licence, set()).update(works)
    shown = {licence: works for licence, works in sorted(groups.items()) if licence.startswith(ASKS)}
    return "\n".join([HEAD, *("\n".join([licence, *sorted(works), ""]) for licence, works in shown.items())])


def _groups(text: str) -> dict[str, list[str]]:
    """The works of an attribution by licence and author.

    Raises:
        ValueError: it is not of the form.
    """
    groups: dict[str, list[str]] = {}
    for line in text.splitlines():
        if heading := re.fullmatch(r"## (.+)", line):
            works = groups.setdefault(heading[1], [])
        elif work := re.fullmatch(r"- `(.+)`: (\S+@\S+), `(.+)`", line):
            if not groups:
                raise ValueError(f"a work without a licence above it: {line!r:.80}")
            works.append(f"  - {work[1]}: {work[2]}, {work[3]}")
        elif line.startswith("-"):
            raise ValueError(f"expected FILE: SOURCE@COMMIT, PATH, found {line!r:.80}")
    if not any(groups.values()):
        raise ValueError("expected an ATTRIBUTION.md of semgs rooms, found no work in it")
    return groups
