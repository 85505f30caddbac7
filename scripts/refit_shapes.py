"""Leave the semantic transformer out of a network whose class backbone says the classes, and teach its head the shapes again.

    python scripts/refit_shapes.py OLD.safetensors NEW.safetensors ROOMS [ROOMS ...]

In such a network the transformer decides only the shapes of semantic Gaussians. The new network has --network.semantic-transformer False; all layers outside
of the semantic head are the old ones. The head learns, on two neighbouring views at a time, the logarithms of the old sizes and the old rotations. ROOMS are
what `semgs train --data` takes. Prints the mean error in held-out rooms, the last of each folder, before and after. The header's scores are left out.
"""

from __future__ import annotations

import argparse
import random
from pathlib import Path

import torch
from torch import Tensor, nn

from semgs.data.scene import Scene
from semgs.data.scenes import open_scene, scene_paths
from semgs.data.views import Views
from semgs.model.build import build
from semgs.model.classes.semantic import SHAPE
from semgs.model.gaussians.placing import LARGEST_SIGMA, SMALLEST_SIGMA
from semgs.model.semgs import SemGS
from semgs.model.switches import switched
from semgs.model.weights.header_scores import KEY as SCORES
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import OWN_KEYS, read_header, save

SIZE = (240, 320)
HELD_OUT = 4
"""Rooms of each folder that only measure."""


def without_transformer(old: SemGS) -> SemGS:
    """A network without the transformer that starts with the layers of another; where the old head saw features before and after the transformer, the new one
    sees those before it twice."""
    new = build(switched(old.settings, {"semantic_transformer": False}), old.classes)
    state = old.state_dict()
    wide = state["semantic.upsampler.conv.weight"]
    state["semantic.upsampler.conv.weight"] = wide.unflatten(1, (2, -1)).sum(1)
    new.load_state_dict(
        {name: tensor for name, tensor in state.items() if not name.startswith("semantic.transformer.")}
    )
    new.temperatures, new.origin = old.temperatures, old.origin
    return new


def neighbours(scene: Scene, draw: random.Random) -> Views:
    """Two neighbouring views of a scene."""
    first = draw.randrange(len(scene) - 1)
    return scene.read([first, first + 1], SIZE)


def shapes(network: SemGS, views: Views) -> Tensor:
    """The raw shapes [view 7 h w] of the semantic head."""
    assert network.semantic is not None
    inputs = network._inputs(views)
    single = network.semantic.refine(inputs, network.cnn)
    return network.semantic(single, inputs)(slice(None))[:, :SHAPE]


def error(raw: Tensor, truth: Tensor) -> tuple[Tensor, Tensor]:
    """Mean difference of log sizes, and mean sine of the angle between quaternions."""
    sizes = [(SMALLEST_SIGMA + (LARGEST_SIGMA - SMALLEST_SIGMA) * one[:, :3].sigmoid()).log() for one in (raw, truth)]
    turned, true = (nn.functional.normalize(one[:, 3:], dim=1) for one in (raw, truth))
    return (sizes[0] - sizes[1]).abs().mean(), (1 - (turned * true).sum(1).square()).clamp(min=1e-9).sqrt().mean()


def measure(old: SemGS, new: SemGS, scenes: list[Scene]) -> str:
    """The errors over some scenes."""
    draw = random.Random(1)
    with torch.no_grad():
        errors = []
        for scene in scenes:
            views = neighbours(scene, draw)
            errors.append(torch.stack(error(shapes(new, views), shapes(old, views))))
    sizes, turns = torch.stack(errors).mean(0).tolist()
    return f"log sizes {sizes:.4f}, rotations {turns:.4f}"


def main() -> None:
    """Refit a network's shapes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=Path)
    parser.add_argument("new", type=Path)
    parser.add_argument("rooms", type=Path, nargs="+")
    parser.add_argument("--steps", type=int, default=500)
    parser.add_argument("--held-out", type=int, default=HELD_OUT)
    given = parser.parse_args()
    torch.manual_seed(0)
    old = load(str(given.old)).eval()
    new = without_transformer(old).eval()
    assert new.semantic is not None
    kept, learned = [], []
    for folder in given.rooms:
        paths = scene_paths(folder)
        learned += [open_scene(path) for path in paths[: -given.held_out]]
        kept += [open_scene(path) for path in paths[-given.held_out :]]
    print("before:", measure(old, new, kept), flush=True)
    parameters = [*new.semantic.upsampler.parameters(), *new.semantic.head[0].parameters()]
    last = new.semantic.head[-1]
    for parameter in new.parameters():
        parameter.requires_grad_(False)
    for parameter in (*parameters, *last.parameters()):
        parameter.requires_grad_(True)
    optimiser = torch.optim.Adam([*parameters, *last.parameters()], lr=2e-3)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, 2e-3, total_steps=given.steps)
    draw = random.Random(0)
    for step in range(given.steps):
        views = neighbours(draw.choice(learned), draw)
        with torch.no_grad():
            truth = shapes(old, views)
        sizes, turns = error(shapes(new, views), truth)
        optimiser.zero_grad()
        (sizes + turns).backward()
        for parameter in last.parameters():  # the classes stay the backbone's
            assert parameter.grad is not None
            parameter.grad[SHAPE:] = 0
        optimiser.step()
        schedule.step()
        if step % 50 == 49:
            print(f"step {step + 1}: log sizes {sizes.item():.4f}, rotations {turns.item():.4f}", flush=True)
    print("after:", measure(old, new, kept), flush=True)
    metadata = read_header(given.old).metadata
    save(given.new, new, {key: text for key, text in metadata.items() if key not in OWN_KEYS | {SCORES}})


if __name__ == "__main__":
    main()
