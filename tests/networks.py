"""Networks for tests, called by the flat names that settings had in format 1 of weights files: shorter than one dataclass a part."""

from __future__ import annotations

from dataclasses import asdict

from semgs.data.classes import SCANNET20, ClassTable
from semgs.model import networks
from semgs.model.build import build
from semgs.model.conventions import OURS
from semgs.model.semgs import SemGS
from semgs.model.switches import switched
from semgs.weights.format1 import todays_settings

BASE = {
    "name": "base", "channels": 128, "cnn_widths": (64, 96, 128), "candidates": 128, "colour_blocks": 6, "semantic_blocks": 3,
    "semantic_pyramid": (), "windows": 2, "expansion": 4, "reduction": 1, "shared_layers": True, "camera_aware_colour": True,
    "camera_aware_semantic": True, "output_transform": True, "cost_width": 128, "cost_hidden": 256, "cost_levels": 3,
    "upsampled_channels": 128, "projected_channels": 32, "refine_width": 32, "refine_levels": 5, "decoder_blocks": 2,
    "colour_hidden": 168, "semantic_hidden": 54, "paper_heads": False, "opacity_hidden": 32, "last_kernel": 3, "harmonics": 25,
    "colour_from_image": False, "gaussian_stride": 1, "cosine_cost": False, "cost_prior": False, "initial_sigma": None,
    "initial_depth_scale": 1.0, "conventions": asdict(OURS),
}  # fmt: skip
"""The preset `base`, as format 1 wrote it."""


def network(classes: ClassTable | None = SCANNET20, **changes: object) -> SemGS:
    """`base` with some of its settings changed."""
    unknown = changes.keys() - BASE.keys()
    assert not unknown, unknown
    if "conventions" in changes:
        changes["conventions"] = asdict(changes["conventions"])  # type: ignore[call-overload]
    return build(todays_settings(BASE | changes, semantic=classes is not None), classes)


def preset(name: str, **changes: object) -> SemGS:
    """The network of a preset, or that with some of its switches set."""
    return build(switched(networks.NETWORKS[name](), changes))
