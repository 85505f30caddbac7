"""LPIPS: used where the user has it, left out where not."""

from __future__ import annotations

import sys
from types import ModuleType

import pytest
import torch

from semgs.evaluation.scoring.frame_scores import perceptual_distance


def test_without_the_package_there_is_none(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "lpips", None)
    assert perceptual_distance() is None


def test_pictures_are_handed_over_clamped_with_a_batch_axis_and_as_0_to_1(monkeypatch: pytest.MonkeyPatch):
    class Network(torch.nn.Module):
        def __init__(self, net: str, verbose: bool) -> None:
            super().__init__()
            assert net == "vgg"

        def forward(self, image: torch.Tensor, truth: torch.Tensor, normalize: bool) -> torch.Tensor:
            assert normalize
            assert image.shape == truth.shape == (1, 3, 5, 7)
            return (image.amax() - truth.amax())[None, None, None, None]

    module = ModuleType("lpips")
    module.LPIPS = Network  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "lpips", module)
    distance = perceptual_distance()
    assert distance is not None
    assert distance(torch.full((3, 5, 7), 1.5), torch.full((3, 5, 7), 0.25)) == 0.75


def test_weights_that_cannot_be_fetched_leave_it_out(monkeypatch: pytest.MonkeyPatch):
    def offline(**_: object) -> None:
        raise OSError("no network")

    module = ModuleType("lpips")
    module.LPIPS = offline  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "lpips", module)
    assert perceptual_distance() is None
