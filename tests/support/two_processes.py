"""Two processes share a step of four scenes, each in two pieces: their gradient, and what they say, beside those of one process.

Called as a script by test_processes.py, with the supervision; Fabric starts the second process by calling it again. Prints a JSON object.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace

import torch
from golden import fill_golden
from networks import network
from posed import posed_views

from semgs.data.tables.classes import IGNORE
from semgs.data.views import Batch, Views, stack
from semgs.model.semgs import SemGS
from semgs.objectives.loss_weights import LossWeights
from semgs.training.run.execution import Execution, Share, launch
from semgs.training.state import TrainingState, descend
from semgs.training.supervision.supervision import make_supervision
from semgs.training.training_settings import TrainingSettings

SIZE, SCENES = (16, 32), 4
TINY = {
    "channels": 16, "cnn_widths": (8, 8, 16), "candidates": 8, "cost_width": 16, "upsampled_channels": 16, "harmonics": 4,
    "refine_width": 16, "refine_levels": 3, "projected_channels": 8, "colour_blocks": 2, "semantic_blocks": 2,
}  # fmt: skip
SETTINGS = TrainingSettings(
    model="small_plain", steps=9, batch=SCENES, size=SIZE, context_targets=True, depth_weight=0.1, clip=1e9,
    losses=LossWeights(semantic=0.5, smoothness=0.5), supervision=sys.argv[1],  # type: ignore[arg-type]
)  # fmt: skip

UNLABELLED = {"rendered": 3, "depth": 0}
"""Views without a label, where labels count."""


def scene(number: int, dtype: torch.dtype) -> Views:
    """Three views; the second scene has few labels, the third has none and no depth either."""
    generator = torch.Generator().manual_seed(number)
    views = posed_views(3, SIZE, seed=number, dtype=dtype)
    labels = torch.randint(0, 20, (3, *SIZE), generator=generator).to(torch.uint8)
    depths = 1 + 3 * torch.rand(3, *SIZE, generator=generator, dtype=dtype)
    if number == 1:
        labels[..., 5:, :] = IGNORE
    if number == 2:
        labels[:], depths[:] = IGNORE, 0
    return replace(views, labels=labels, depths=depths)


def batch(scenes: range, dtype: torch.dtype) -> Batch:
    both = stack([scene(number, dtype) for number in scenes])
    return Batch(both.select([0, 1]), both.select([2]), tuple(map(str, scenes)))


def gradient(model: SemGS) -> torch.Tensor:
    return torch.cat([parameter.grad.flatten() for parameter in model.parameters() if parameter.requires_grad])


def compare(fabric, dtype: torch.dtype) -> dict[str, float]:
    """The relative difference of the gradients and of the reports, as the first process sees them."""
    share = Share(fabric.global_rank, fabric.world_size, accumulate=2)
    found = []
    for engine, pieces in ((fabric, share.pieces(0, SCENES)), (None, Share().pieces(0, SCENES))):
        model = fill_golden(network(**TINY)).to(dtype)
        state = TrainingState.begin(model, make_supervision(SETTINGS), 1e-3, 0.9, engine)
        report = descend(state, [batch(piece, dtype) for piece in pieces], SETTINGS.clip, 1e-3)
        found.append((gradient(model), report))
    (shared, said), (whole, alone) = found
    return {
        "gradient": float((shared - whole).norm() / whole.norm()),
        "report": max(
            abs(getattr(said, name) - getattr(alone, name))
            for name in ("total", "semantic", "depth", "gradients", "distribution")
        )
        + (0 if SETTINGS.supervision == "depth" else abs(said.psnr - alone.psnr)),
        "unlabelled": abs(said.unlabelled - alone.unlabelled) + (alone.unlabelled != UNLABELLED[SETTINGS.supervision]),
        "moved": float(said.moved and alone.moved),
    }


def broken(fabric) -> bool:
    """Whether both processes skip a step that is broken in one of them alone."""
    state = TrainingState.begin(fill_golden(network(**TINY)), make_supervision(SETTINGS), 1e-3, 0.9, fabric)
    if fabric.global_rank == 1 and SETTINGS.supervision == "depth":
        state.model.cnn.register_forward_hook(lambda module, inputs, features: features * torch.nan)
    elif fabric.global_rank == 1:
        state.model.register_forward_hook(
            lambda module, inputs, encoding: replace(
                encoding, gaussians=encoding.gaussians.map(lambda tensor: tensor * torch.nan)
            )
        )
    share = Share(fabric.global_rank, fabric.world_size)
    report = descend(state, [batch(piece, torch.float32) for piece in share.pieces(0, SCENES)], SETTINGS.clip, 1e-3)
    return not report.moved


def main() -> None:
    fabric = launch(Execution(devices=2))
    found = {name: compare(fabric, dtype) for name, dtype in (("double", torch.float64), ("single", torch.float32))}
    skipped = fabric.all_reduce(torch.tensor(float(broken(fabric))), reduce_op="sum")
    if fabric.is_global_zero:
        print(json.dumps({**found, "skipped": float(skipped), "world": fabric.world_size}))


if __name__ == "__main__":
    torch.set_num_threads(1)
    sys.exit(main())
