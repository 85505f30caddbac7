"""The engine: what it does to a forward pass, and what it must leave alone."""

from __future__ import annotations

import sys

import pytest
import torch
from posed import posed_views
from torch import nn

from semgs.training.run.execution import Execution, launch


class Probe(nn.Module):
    """Says what it sees."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Linear(3, 2)

    def forward(self, views, double):
        self.seen = views
        hidden = self.layer(views.images.flatten(2).mT)
        return {"hidden": hidden, "double": double}


@pytest.mark.parametrize(
    ("precision", "dtype"), [("float32", torch.float32), ("auto", torch.float32), ("bf16", torch.bfloat16)]
)
def test_layers_compute_in_the_precision_asked_for_and_nothing_else_is_touched(precision, dtype):
    fabric = launch(Execution(precision=precision))
    probe = Probe()
    views = posed_views(2, (16, 24), seed=1)
    found = fabric.setup_module(probe)(views, torch.ones(3, dtype=torch.float64))
    assert probe.seen is views
    assert found["hidden"].dtype == dtype
    assert found["double"].dtype == torch.float64
    fabric.backward(found["hidden"].float().sum())
    assert probe.layer.weight.grad.dtype == torch.float32


def test_one_process_leads_and_agrees_with_itself():
    fabric = launch(Execution())
    assert (fabric.is_global_zero, fabric.world_size, fabric.global_rank) == (True, 1, 0)
    assert fabric.broadcast({"step": 3}) == {"step": 3}
    assert float(fabric.all_reduce(torch.tensor(2.5), reduce_op="sum")) == 2.5


def test_without_lightning_fabric_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "lightning_fabric", None)
    with pytest.raises(ImportError, match=r"'\.\[train\]'"):
        launch(Execution())
