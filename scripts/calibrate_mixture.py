"""Calibrate the confidence of weights on rooms and on labelled photos alike, and write them with the fitted temperatures.

    python scripts/calibrate_mixture.py WEIGHTS OUT.safetensors SCENES PHOTOS

SCENES is what `semgs weights calibrate --data` takes. PHOTOS are labelled images without cameras (docs/train.md). A photo becomes a pair of input views that show the same
from cameras a few centimetres apart, and is rendered from the first of them, because temperatures are for rendered pixels and for single Gaussians. Both kinds
of data count alike. The table has the expected calibration error of each before and after.
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch

from semgs.data.resampling import default_size
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.views import joined
from semgs.evaluation.run import open_labelled_scenes, plan_targets
from semgs.evaluation.scoring.confidence_calibration import (
    KINDS,
    PIXELS,
    Statements,
    collect_statements,
    measure_temperature,
    sample_statements,
)
from semgs.geometry.cameras import Cameras
from semgs.model.encode import encode
from semgs.model.semgs import SemGS
from semgs.model.weights.header import TEMPERATURES as KEY
from semgs.model.weights.header import temperatures_text
from semgs.model.weights.load import find, load
from semgs.model.weights.weights_file import restate
from semgs.rendering.temperatures import Temperatures

BASELINE = 0.05
"""Distance of the two cameras of a photo [m]."""


@torch.no_grad()
def statements_of_photos(photos: Scene, network: SemGS, seed: int = 0) -> dict[str, Statements]:
    """Class distributions on labelled photos, as `collect_statements` gives them for scenes."""
    generator = torch.Generator().manual_seed(seed)
    found: dict[str, list[Statements]] = {kind: [] for kind in KINDS}
    for index, frame in enumerate(photos.frames):
        view = photos.read([index], default_size(frame.lens.size))
        beside = view.cameras.world_from_camera.clone()
        beside[..., 0, 3] += BASELINE
        moved = view.changed(cameras=Cameras(beside, view.cameras.intrinsics, view.size))
        encoding = encode(network, joined([view, moved])).encoding
        rendered = encoding.render(view.cameras).semantics
        assert rendered is not None
        labels = [None if view.labels is None else view.labels[0]]
        found["rendered"] += sample_statements(rendered, labels, PIXELS, generator)
        found["gaussians"] += sample_statements(encoding.class_maps()[:1], labels, PIXELS, generator)
    return {kind: _joined(parts) for kind, parts in found.items()}


def _joined(parts: list[Statements]) -> Statements:
    """All of them concatenated."""
    return Statements(torch.cat([one.distributions for one in parts]), torch.cat([one.labels for one in parts]))


def _sampled(whole: Statements, count: int) -> Statements:
    """So many of them at random."""
    chosen = torch.randperm(len(whole.labels), generator=torch.Generator().manual_seed(0))[:count]
    return Statements(whole.distributions[chosen], whole.labels[chosen])


def main(weights: str, out: str, scenes: str, photos: str) -> None:
    """Fit, write and print."""
    name, path = find(weights)
    network = load(name, path)
    plan = plan_targets(("neighbours",), open_labelled_scenes(Path(scenes)).scenes, (2,))
    rooms = collect_statements(plan, network)
    images = statements_of_photos(open_scene(photos, needs_cameras=False), network)
    fitted = {}
    for kind in KINDS:
        count = min(len(rooms[kind].labels), len(images[kind].labels))
        mixture = _joined([_sampled(rooms[kind], count), _sampled(images[kind], count)])
        fitted[kind] = measure_temperature(mixture).temperature
        for label, part in (("rooms", rooms[kind]), ("photos", images[kind])):
            effect = measure_temperature(part, fitted[kind])
            print(
                f"{kind} {label}: temperature {fitted[kind]}, ECE {effect.error_before:.3f} to {effect.error_after:.3f}"
            )
    restate(path, out, {KEY: temperatures_text(Temperatures(**fitted))})


if __name__ == "__main__":
    if len(sys.argv) != 5:
        sys.exit(__doc__)
    main(*sys.argv[1:])
