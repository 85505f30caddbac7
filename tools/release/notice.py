"""Write NOTICE: works whose licences require attribution in the rooms that weights are trained on, and published networks.

The works come from ATTRIBUTION.md, which `semgs rooms --assets` writes next to its scenes. Rooms that training generates from the same
seed and assets contain the same works.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from semgs.files.atomic import write_text
from semgs.files.errors import InputError
from tools.release.pages import ROOT

ASKS = "CC-BY"
"""Prefix of licences that require attribution."""

HEAD = """\
SemGS
Apache-2.0, see LICENSE.

Rooms that the weights of SemGS are trained in show models and textures by others. Those under licences that ask for attribution (CC-BY) are
named here: the file in the folder of assets, the repository that it is from at a commit, and its path there. The others are CC0, in
the public domain, ours, Apache-2.0, MIT or BSD-3-Clause; `semgs rooms --assets` writes the list of all (ATTRIBUTION.md) beside the rooms that it draws.
"""


NETWORKS = """
The class branch of the weights of SemGS was trained on, every layer, from the MobileNetV2 of a published segmentation network, and learned what
another one says of rooms. Both are Apache-2.0; their weights were dequantised, renamed and transposed, and are not in this package.

Apache-2.0 (MLCommons Association License), github.com/mlcommons/mobile_open@86a873714efd
  - start: vision/deeplab/models_and_code/checkpoints/quantize_aware_training/freeze_qat.tflite (DeepLabv3+ on MobileNetV2, ADE20K's 31 commonest classes)
  - teacher: vision/mosaic/models_and_checkpoints/R4/mobile_segmenter_r4_quant_argmax_uint8.tflite (MOSAIC, the same classes)
"""
"""Published networks from which the included weights were initialised or distilled."""

VIDEOS = """
Videos of `semgs render` are encoded by PyAV (BSD-3-Clause), an optional dependency that SemGS neither contains nor distributes. PyAV's wheels on the Python Package
Index contain FFmpeg built with x264 and x265, which are under the GPL-2.0-or-later: whoever passes on such a wheel, in an image of a container for example, has to keep to its terms.
"""
"""An optional dependency whose wheel contains works under the GPL."""


def write_notice(attributions: Sequence[Path]) -> None:
    """Write NOTICE from files `ATTRIBUTION.md`.

    Raises:
        InputError: one of them cannot be read or is no ATTRIBUTION.md.
    """
    try:
        text = notice([path.read_text(encoding="utf-8") for path in attributions])
    except (OSError, ValueError) as error:
        raise InputError(", ".join(map(str, attributions)), "ATTRIBUTION.md of semgs rooms", str(error)) from error
    write_text(ROOT / "NOTICE", text + NETWORKS + VIDEOS)


def notice(attributions: Sequence[str]) -> str:
    """The text of NOTICE.

    Args:
        attributions: texts of `ATTRIBUTION.md`, from `semgs.rooms.assets.lock.attribution`; works in several of them are listed once.

    Raises:
        ValueError: one of them is malformed or lists no work.
    """
    groups: dict[str, set[str]] = {}
    for text in attributions:
        for licence, works in _groups(text).items():
            groups.setdefault(licence, set()).update(works)
    shown = {licence: works for licence, works in sorted(groups.items()) if licence.startswith(ASKS)}
    return "\n".join([HEAD, *("\n".join([licence, *sorted(works), ""]) for licence, works in shown.items())])


def _groups(text: str) -> dict[str, list[str]]:
    """The works of an attribution by licence and author; a ValueError if it is malformed."""
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
        raise ValueError("expected an ATTRIBUTION.md of semgs rooms, found none of its works")
    return groups
