"""Which tensors belong to which part of a network."""

from __future__ import annotations

import pytest
from networks import network, preset

from semgs.data.tables.classes import SCANNET20
from semgs.model import networks
from semgs.model.build import build
from semgs.model.semgs import PARTS, SemGS

NETWORKS = {
    "small": lambda: preset("small_plain"),
    "the paper's heads": lambda: preset("small_plain", paper_heads=True),
    "a CNN of its own": lambda: preset("small_plain", shared_layers=False),
    "the backbone": lambda: preset("small_plain", class_backbone=True),
    "the cue": lambda: preset("small_plain", class_backbone=True, depth_cue=True, cost_filter=8),
    "convex": lambda: preset("small_plain", depth_upsampling="convex"),
    "colour only": lambda: build(networks.small_plain(), None),
}


@pytest.fixture(params=NETWORKS.values(), ids=NETWORKS.keys())
def model(request) -> SemGS:
    return request.param()


def test_every_tensor_is_in_exactly_one_part(model: SemGS):
    parts = model.parts()
    assert tuple(parts) == PARTS
    assert sum(len(names) for names in parts.values()) == len(model.state_dict())
    assert frozenset().union(*parts.values()) == model.state_dict().keys()


def counts(model: SemGS) -> dict[str, int]:
    """Tensors of each part by the layers that they are of."""
    return {part: len(names) for part, names in model.parts().items()}


def test_tensors_of_a_network_counted_by_hand():
    model = network(
        classes=SCANNET20, channels=16, cnn_widths=(8, 8, 16), candidates=8, colour_blocks=1, semantic_blocks=1, cost_width=8,
        cost_levels=1, refine_width=8, refine_levels=1, decoder_blocks=1, upsampled_channels=16, projected_channels=8,
    )  # fmt: skip
    # CNN: conv1, six blocks of two convolutions without bias, one 1x1 with bias where the width changes (8 to 16) or the stride
    # is 2 (8 to 8), conv2 with bias.
    cnn = 1 + 6 * 2 + 2 * 2 + 2
    # A transformer block: two attentions of four projections and a norm, the second with two layers and a norm more.
    block = 2 * (4 + 2) + 2 + 2
    # A U-Net of one level: stem; a residual block (two convolutions, two norms); attention (qkv, proj, norm); two blocks in the middle; a
    # block with a wider input, whose skip is a convolution, and attention; out: convolution and norm. Two tensors each.
    unet = 2 * (1 + 4 + 3 + 2 * 4 + 5 + 3 + 2)
    regressor = 2 * 3 + unet + 2 + 2 * 2  # convolution, norm, convolution; residual; head
    upsampler, refinement, head = 2, 2 + 2 * 2 + unet + 2 * 2, 2 * 2
    assert counts(model) == {
        "shared": cnn, "depth": block + regressor + upsampler + refinement, "colour": head,
        "semantic": 2 * 2 + block + upsampler + 2, "classes": 2,
    }  # fmt: skip


def test_what_is_shared_is_the_depths_where_the_semantic_branch_has_a_cnn_of_its_own():
    shared, own = preset("small_plain").parts(), preset("small_plain", shared_layers=False).parts()
    assert all(name.startswith("cnn.") for name in shared["shared"])
    assert own["shared"] == frozenset()
    assert own["depth"] == shared["depth"] | shared["shared"]
    assert len(own["semantic"]) == len(shared["semantic"]) + len(shared["shared"])


def test_a_network_of_colour_alone_has_neither_semantics_nor_classes():
    assert [part for part, names in build(networks.small_plain(), None).parts().items() if not names] == [
        "shared",
        "semantic",
        "classes",
    ]


def test_the_layers_of_the_classes_are_the_heads_last_and_the_backbones():
    assert preset("small_plain", class_backbone=True).parts()["classes"] == {
        "semantic.head.2.weight", "semantic.head.2.bias",
        "semantic.refinement.classifier.weight", "semantic.refinement.classifier.bias",
    }  # fmt: skip


def test_a_backbone_reads_no_shallow_features_so_depth_keeps_them_for_itself():
    model = preset("small_plain", class_backbone=True)
    parts = model.parts()
    assert parts["shared"] == frozenset()
    assert {name for name in parts["depth"] if name.startswith("cnn.")} == preset("small_plain").parts()["shared"]
    assert (
        len(model.pretrained_parameters()) == 102
    )  # stem, first block of two convolutions, sixteen of three; weight and bias
