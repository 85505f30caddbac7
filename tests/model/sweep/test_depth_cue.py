"""Depth's cue: coarse maps of what each view shows by itself, lent by the class branch."""

from __future__ import annotations

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_views

from semgs.model import networks
from semgs.model.build import build
from semgs.model.sweep.unet import Downsample, UNet
from semgs.model.switches import switched

CUED = {"class_backbone": True, "depth_cue": True}


def test_maps_join_a_u_net_where_its_maps_have_their_size():
    """Adding a constant map at a level is adding it to the bias of the convolution that leads there."""
    torch.manual_seed(0)
    unet, x = UNet(8, 3).double(), torch.rand(2, 8, 8, 12, dtype=torch.float64)
    seen = [torch.full((2, 8, 4, 6), 0.5, dtype=torch.float64), torch.full((2, 8, 2, 3), -2.0, dtype=torch.float64)]
    with torch.no_grad():
        joined, first = unet(x, 2, seen), unet(x, 2, seen[:1])
        strided = [one for one in unet.modules() if isinstance(one, Downsample)]
        strided[0].op.bias += 0.5
        torch.testing.assert_close(first, unet(x, 2))
        strided[1].op.bias -= 2.0
        torch.testing.assert_close(joined, unet(x, 2))


def test_the_cue_starts_without_a_say_and_has_one_once_it_learned():
    model = fill_golden(preset("small_plain", **CUED)).eval()
    views = posed_views(2, (32, 48))
    last = [layers[-1] for layers in model.colour.depth.regressor.cues]
    with torch.no_grad():
        told = model.sweep(views).depths
        for layer in last:
            layer.weight.zero_()
            layer.bias.zero_()
        silent = model.sweep(views).depths
    assert not torch.equal(told, silent)
    fresh = build(switched(networks.small_plain(), CUED)).colour.depth.regressor.cues
    assert [(layers[0].num_channels, layers[-1].weight.abs().max().item()) for layers in fresh] == [(32, 0), (96, 0)]


def test_depth_sees_the_cues_that_the_class_branch_gives_and_never_teaches_it():
    model = fill_golden(preset("small_plain", **CUED))
    views = posed_views(2, (32, 48))
    model.sweep(views).depths.sum().backward()
    taught = {name for name, one in model.named_parameters() if one.grad is not None}
    assert taught == model.depth_parameters()
    assert {name for name in taught if "cues" in name}
    pictures = torch.rand(1, 3, 32, 48)
    assert not any(
        cue.requires_grad
        for cue in model.semantic.refinement.cues(pictures, model.semantic.refinement(pictures, model.cnn).cue_maps)
    )
    backbone = model.pretrained_parameters()
    assert not taught & backbone
    assert backbone <= model.parts()["shared"], "depth and classes both depend on it"
    assert backbone <= model.semantic_parameters()
    assert not backbone & model.semantic_parameters(shared=False), "held, it leaves depth as it is"


def test_the_sweep_alone_and_the_whole_network_see_the_same_cues():
    model = fill_golden(preset("small_plain", **CUED)).eval()
    views = posed_views(2, (32, 48))
    with torch.inference_mode():
        spread, coarse = model(views).depth_spread, model.sweep(views)
    logs = coarse.candidates.log()[..., None, None]
    mean = (coarse.probabilities * logs).sum(-3, keepdim=True)
    by_hand = (coarse.probabilities * (logs - mean).square()).sum(-3).sqrt()
    torch.testing.assert_close(spread[..., 2::4, 2::4], by_hand, rtol=1e-4, atol=1e-5)


def test_a_cue_without_the_backbone_that_gives_it_is_refused():
    with pytest.raises(ValueError, match="depth_cue needs the class backbone"):
        preset("small_plain", depth_cue=True)
    with pytest.raises(ValueError, match="depth_cue needs the class backbone"):
        build(switched(networks.small_plain(), CUED), None)
