from __future__ import annotations

from contextlib import contextmanager

import pytest
import torch
from golden import fill_golden
from networks import network, preset
from posed import posed_views

from semgs.data.views import stack
from semgs.model.layers.network_input import Chunks, by_chunks
from semgs.model.semgs import STAGES
from semgs.scene.encoding import Encoding

SIZE = (32, 48)


def tensors(encoding: Encoding) -> list[torch.Tensor]:
    found: list[torch.Tensor] = []
    encoding.map(lambda tensor: found.append(tensor) or tensor)
    return found


LONG = pytest.mark.long


@pytest.mark.parametrize("name", ["small_plain", pytest.param("base", marks=LONG), "text"])
@pytest.mark.parametrize(
    "chunks",
    [pytest.param(Chunks(cost=1), marks=LONG), pytest.param(Chunks(heads=1), marks=LONG), Chunks(cost=2, heads=2)],
)
def test_a_few_views_at_a_time_give_what_all_give_at_once(name: str, chunks: Chunks) -> None:
    model = fill_golden(network(paper_heads=True) if name == "text" else preset(name))
    views = posed_views(3, (93, 127) if name == "small_plain" else SIZE)
    with torch.inference_mode():
        whole, parts = model(views), model(views, chunks)
    for one, other in zip(tensors(whole), tensors(parts), strict=True):
        assert one.shape == other.shape
        assert (one - other).norm() <= 1e-6 * one.norm()


def test_a_batch_in_chunks_is_that_batch() -> None:
    model = fill_golden(preset("small_plain")).double()
    batch = stack(
        [posed_views(2, SIZE, seed=1, dtype=torch.float64), posed_views(2, SIZE, seed=5, dtype=torch.float64)]
    )
    with torch.inference_mode():
        whole, parts = model(batch), model(batch, Chunks(1, 3))
    for one, other in zip(tensors(whole), tensors(parts), strict=True):
        assert (one - other).norm() <= 1e-12 * one.norm()


def test_gradients_pass_through_chunks() -> None:
    values = torch.randn(5, 3, requires_grad=True)
    by_chunks(lambda at: values[at] ** 2, 5, 2).sum().backward()
    assert values.grad is not None
    assert torch.equal(values.grad, 2 * values.detach())


def test_chunks_of_no_view_are_refused() -> None:
    with pytest.raises(ValueError, match="heads is 0; expected 1 view or more"):
        Chunks(heads=0)


def test_every_stage_is_told_once_and_in_order() -> None:
    told: list[str] = []

    @contextmanager
    def stage(name: str):
        told.append(name)
        yield
        told.append("end")

    with torch.inference_mode():
        fill_golden(preset("small_plain"))(posed_views(2, SIZE), stage=stage)
    assert told == [text for name in STAGES for text in (name, "end")]
