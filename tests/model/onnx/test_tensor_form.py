"""The network as a function of tensors gives what the network gives, in float32 and with operations that ONNX has."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from float32_cameras import float32_cameras
from golden import fill_golden
from networks import preset
from posed import posed_cameras, posed_views
from torch.overrides import TorchFunctionMode

from semgs.model.layers.network_input import WHOLE
from semgs.model.onnx import tensor_form
from semgs.model.onnx.tensor_form import (
    StandardOperations,
    TensorForm,
    arguments,
    correlate_all_texels,
    distances,
    inverse_intrinsics,
)
from semgs.model.semgs import SemGS
from semgs.model.sweep.correlation import correlate_fused
from semgs.scene.encoding import Encoding

SIZE = (32, 48)


def arrays(encoding: Encoding) -> dict[str, torch.Tensor]:
    """What a `TensorForm` gives."""
    maps = {name: getattr(encoding, name) for name in ("depths", "confidences", "depth_spread")}
    return replace(encoding.gaussians, footprints=None).tensors() | maps


def filled(name: str, **switches: object) -> SemGS:
    """A network of which every weight has a say."""
    return fill_golden(preset(name, **switches)).eval().requires_grad_(False)


@pytest.mark.parametrize(("name", "views"), [("small", 2), ("small", 3), ("small_plain", 2)])
def test_the_form_gives_the_arrays_of_the_network(name: str, views: int):
    network, given = filled(name), posed_views(views, SIZE)
    expected = arrays(network(given, WHOLE))
    with float32_cameras():
        found = TensorForm(network)(*arguments(given))
    assert list(found) == list(expected)
    for array in expected:
        assert found[array].dtype == torch.float32
        limit = 1e-4 if array in ("means", "depths") else 1e-3
        assert (found[array] - expected[array]).abs().max() < limit, array


@pytest.mark.long
@pytest.mark.parametrize("name", ["base", "base_text", "mvsplat"])
def test_the_form_is_as_precise_as_the_network_where_float32_itself_costs_a_millimetre(name: str):
    network, given = filled(name), posed_views(2, SIZE)
    expected = arrays(network(given, WHOLE))
    with float32_cameras():
        found = TensorForm(network)(*arguments(given))
    exact = arrays(network.double()(given.changed(images=given.images.double()), WHOLE))
    for array in expected:
        own, others = ((one[array] - exact[array]).abs().max() for one in (expected, found))
        assert others < 4 * own + 1e-5, array


def test_the_form_changes_no_bit_of_what_the_network_gives_afterwards():
    network, given = filled("small_plain"), posed_views(2, SIZE)
    before = arrays(network(given, WHOLE))
    with float32_cameras():
        TensorForm(network)(*arguments(given))
    after = arrays(network(given, WHOLE))
    assert all(torch.equal(before[name], after[name]) for name in before)


def test_no_operation_of_the_form_sees_float64():
    seen = set()

    class Watch(TorchFunctionMode):
        def __torch_function__(self, func, types, args=(), kwargs=None):
            result = func(*args, **(kwargs or {}))
            seen.update({result.dtype} if isinstance(result, torch.Tensor) else ())
            return result

    form, inputs = TensorForm(filled("small_plain")), arguments(posed_views(2, SIZE))
    with float32_cameras(), Watch():
        form(*inputs)
    assert torch.float32 in seen
    assert torch.float64 not in seen


def test_the_inverse_of_intrinsics_is_that_of_the_matrix():
    k = posed_cameras(3, SIZE).intrinsics.clone()
    k[:, 0, 1] = torch.tensor([0.0, 1.5, -2.0])
    assert torch.allclose(inverse_intrinsics(k), torch.linalg.inv(k), atol=1e-15, rtol=1e-12)
    by_hand = torch.tensor([[2.0, 4.0, 6.0], [0.0, 8.0, 16.0], [0.0, 0.0, 1.0]])
    assert inverse_intrinsics(by_hand).tolist() == [[0.5, -0.25, 1.0], [0.0, 0.125, -2.0], [0.0, 0.0, 1.0]]


def test_distances_are_those_of_cdist():
    a, b = torch.tensor([[0.0, 0.0, 0.0], [1.0, 2.0, 2.0]]), torch.tensor([[3.0, 4.0, 0.0]])
    assert distances(a, b)[0].item() == 5
    assert distances(a, a)[0, 1].item() == 3
    assert torch.allclose(distances(a[None], b[None]), torch.cdist(a[None], b[None]))


@pytest.mark.parametrize("mask_unseen", [False, True])
@pytest.mark.parametrize("largest", [2**25, 100])
def test_products_of_all_texels_give_the_correlation_of_the_compiled_operation(
    mask_unseen: bool, largest: int, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(tensor_form, "LARGEST_PRODUCT", largest)  # 100: two texels at a time
    generator = torch.Generator().manual_seed(0)
    reference, source = torch.randn(2, 3, 6, 8, 5, generator=generator).unbind()
    matrices = torch.eye(3).repeat(3, 1, 1) + 0.05 * torch.randn(3, 3, 3, generator=generator)
    offsets, depths = 2 * torch.randn(3, 3, generator=generator), torch.linspace(8, 0.5, 20).repeat(3, 1)
    inputs = (reference, source, matrices, offsets, depths, torch.full((3,), 0.3), mask_unseen)
    (sums, seen), (expected, visible) = correlate_all_texels(*inputs), correlate_fused(*inputs)
    assert 0.1 < visible.mean() < 0.9
    assert torch.equal(seen, visible)
    assert (sums - expected).abs().max() < 1e-4


def test_a_sample_between_two_texels_is_the_mean_of_their_products():
    """Everything moves half a texel to the right: product 1 x 2 with the first and 1 x 4 with the second texel."""
    reference, source = torch.ones(1, 1, 2, 1), torch.tensor([2.0, 4.0]).reshape(1, 1, 2, 1)
    inputs = (
        reference,
        source,
        torch.eye(3)[None],
        torch.tensor([[0.5, 0.0, 0.0]]),
        torch.ones(1, 1),
        torch.tensor([0.1]),
    )
    sums, seen = correlate_all_texels(*inputs, True)
    assert sums.flatten().tolist() == [3, 4]  # beyond the last texel's centre is its own value, to the edge
    assert seen.flatten().tolist() == [1, 1]
    assert correlate_all_texels(*inputs, False)[0].flatten().tolist() == [3, 2]  # beyond it are zeros


def test_operations_that_onnx_lacks_are_replaced_inside_only():
    k = torch.tensor([[2.0, 0.0, 6.0], [0.0, 8.0, 16.0], [0.0, 0.0, 1.0]], dtype=torch.float64)
    with StandardOperations():
        inside = torch.linalg.inv(k), torch.eye(2, dtype=torch.float64)
    assert [one.dtype for one in inside] == [torch.float32, torch.float32]
    assert torch.linalg.inv(k).dtype == torch.eye(2, dtype=torch.float64).dtype == torch.float64
