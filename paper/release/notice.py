"""Write NOTICE: works whose licences require attribution in the rooms that weights are trained on, labelled photos, and published networks.

The works come from ATTRIBUTION.md, which `semgs rooms --assets` writes next to its scenes. Rooms that training generates from the same
seed and assets contain the same works. The photos come from sources.json, a list of their images with set, path, licence and address.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path, PurePath
from typing import Any

from paper.release.pages import ROOT
from semgs.files.atomic import write_text
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json

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
The class branch of the weights of SemGS was trained on, every layer, from the MobileNetV2 of a published segmentation network and from another such network,
MOSAIC, and learned what MOSAIC says of rooms. Both are Apache-2.0; their weights were dequantised, renamed and transposed (a change), then trained on (another).

Apache-2.0 (MLCommons Association License), github.com/mlcommons/mobile_open@86a873714efd
  - start: vision/deeplab/models_and_code/checkpoints/quantize_aware_training/freeze_qat.tflite (DeepLabv3+ on MobileNetV2, ADE20K's 31 commonest classes)
  - start and teacher: vision/mosaic/models_and_checkpoints/R4/mobile_segmenter_r4_quant_argmax_uint8.tflite (MOSAIC, by Weijun Wang and Andrew Howard, the same classes)
"""
"""Published networks from which the included weights were initialised or distilled."""

PHOTOS = """
The class branch of the weights of SemGS was also trained on labelled photos of real rooms, which are not in this package. The labels are CC0, drawn for SemGS. Photos of
Poly Haven's panoramas are CC0. Those under other licences are named here: their authors are in the metadata of Open Images V4 (storage.googleapis.com/openimages, image ids below), and behind
the addresses at Flickr that COCO states.
"""
"""Heading of the labelled photos."""

TUM = "CC BY 4.0, TUM RGB-D benchmark (Sturm, Engelhard, Endres, Burgard, Cremers, IROS 2012), frames of these sequences, reduced"
"""Heading of the photos from that benchmark."""

COCO_LICENCES = {
    4: "CC BY 2.0",
    5: "CC BY-SA 2.0",
    7: "no known copyright restrictions",
    8: "United States government work",
}
"""Licences of COCO's images by their number."""

IDS_IN_A_LINE = 8

VIDEOS = """
Videos of `semgs render` are encoded by PyAV (BSD-3-Clause), an optional dependency that SemGS neither contains nor distributes. PyAV's wheels on the Python Package
Index contain FFmpeg built with x264 and x265, which are under the GPL-2.0-or-later: whoever passes on such a wheel, in an image of a container for example, has to keep to its terms.
"""
"""An optional dependency whose wheel contains works under the GPL."""


def write_notice(attributions: Sequence[Path], sources: Path) -> None:
    """Write NOTICE.

    Args:
        attributions: files `ATTRIBUTION.md`.
        sources: `sources.json` of the labelled photos.

    Raises:
        InputError: one of them cannot be read, or is something else.
    """
    try:
        text = notice([path.read_text(encoding="utf-8") for path in attributions])
    except (OSError, ValueError) as error:
        raise InputError(", ".join(map(str, attributions)), "ATTRIBUTION.md of semgs rooms", str(error)) from error
    listed = read_json(sources, "a list of photos")
    write_text(ROOT / "NOTICE", text + NETWORKS + photos(listed) + VIDEOS)


def photos(listed: Any) -> str:
    """The section of NOTICE on labelled photos.

    Args:
        listed: the content of `sources.json`.
    """
    ids = sorted(PurePath(one["path"]).stem for one in listed if one["set"].startswith("openimages"))
    coco = sorted((one["licence_id"], one["flickr_url"]) for one in listed if one["set"].startswith("coco"))
    lines = [PHOTOS, f"CC BY 2.0, Open Images V4, by way of MiguelARD/DoorDetect-Dataset ({len(ids)} photos)"]
    lines += [f"  {' '.join(ids[start : start + IDS_IN_A_LINE])}" for start in range(0, len(ids), IDS_IN_A_LINE)]
    for number, licence in COCO_LICENCES.items():
        if addresses := [address for known, address in coco if known == number]:
            lines += ["", f"{licence}, COCO", *(f"  - {address}" for address in addresses)]
    if frames := sorted({f"{one['sequence']}" for one in listed if one["set"].startswith("tum")}):
        lines += ["", TUM, *(f"  - {sequence}" for sequence in frames)]
    return "\n".join([*lines, ""])


def notice(attributions: Sequence[str]) -> str:
    """The text of NOTICE.

    Args:
        attributions: texts of `ATTRIBUTION.md`, from `semgs_rooms.assets.lock.attribution`; works in several of them are listed once.

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
