"""How strong the smoothness loss is beside the cross-entropy: norms of their gradients in the semantic branch, for views with labels.

    python scripts/smoothness_gradient.py WEIGHTS ROOMS

Two neighbouring views of each scene, at 120x160. Prints the norm of the cross-entropy's gradient, that of the smoothness as a mean and as a sum over pixels,
both unweighted, and the weight of the mean, as a multiple of the paper's, at which the two weighted gradients are equal; means over scenes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import torch
from torch import Tensor

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.views import Views
from semgs.model.layers.network_input import widen
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load
from semgs.objectives.loss_weights import LossWeights
from semgs.objectives.losses import cross_entropy, regional_smoothness

SIZE = (120, 160)


def gradient_norm(value: Tensor, parameters: Iterable[Tensor]) -> float:
    """The norm of the gradient of a number by all parameters together."""
    found = torch.autograd.grad(value, list(parameters), retain_graph=True, allow_unused=True)
    return float(torch.stack([part.square().sum() for part in found if part is not None]).sum().sqrt())


def norms(network: SemGS, views: Views) -> dict[str, float]:
    """The norms of the gradients of the three terms in the branch's own parameters."""
    assert views.labels is not None
    named = dict(network.named_parameters())
    own = [named[name].requires_grad_() for name in network.semantic_parameters(shared=False)]
    distributions = network.class_maps(views).distributions
    pixels = widen(distributions, network.stride)[..., : views.size[0], : views.size[1]]
    terms = {
        "cross-entropy": cross_entropy(distributions, views.labels, stride=network.stride).mean(),
        "pixels": regional_smoothness(pixels, views.labels, "pixels").mean(),
        "sum": regional_smoothness(pixels, views.labels, "sum").mean(),
    }
    return {name: gradient_norm(value, own) for name, value in terms.items()}


def main(weights: str, rooms: str) -> None:
    """Print the means over the scenes of a folder."""
    network, paper = load(weights), LossWeights()
    found = [norms(network, open_scene(path).read([0, 1], SIZE)) for path in scene_paths(Path(rooms))]
    mean = {name: sum(one[name] for one in found) / len(found) for name in found[0]}
    entropy = paper.semantic * mean["cross-entropy"]
    print(f"{len(found)} scenes; norms: " + ", ".join(f"{name} {value:.4g}" for name, value in mean.items()))
    print(
        f"weighted as in the paper, beside the cross-entropy: mean {paper.smoothness * mean['pixels'] / entropy:.3g}, sum {paper.smoothness * mean['sum'] / entropy:.3g}"
    )
    print(f"equal at {entropy / (paper.smoothness * mean['pixels']):.0f} times the paper's weight of the mean")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
