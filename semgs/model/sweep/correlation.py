"""The correlation of the plane sweep as one differentiable operation on the CPU, without warped features in memory."""

from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.model.sweep import correlation_kernels as kernels
from semgs.runtime.kernels import in_threads, operation


def correlate_fused(
    reference: Float[Tensor, "n h w c"],
    source: Float[Tensor, "n h w c"],
    matrices: Float[Tensor, "n 3 3"],
    offsets: Float[Tensor, "n 3"],
    depths: Float[Tensor, "n l"],
    smallest: Float[Tensor, " n"],
    mask_unseen: bool,
) -> tuple[Float[Tensor, "n l h w"], Float[Tensor, "n l h w"]]:
    """The same as `semgs.model.sweep.cost_volume.correlate`, with channels last and gradients only for the two feature maps."""
    sums, seen = _correlate(reference, source, matrices, offsets, depths, smallest, mask_unseen)
    return sums, seen


@operation
def _correlate(
    reference: Tensor, source: Tensor, matrices: Tensor, offsets: Tensor, depths: Tensor, smallest: Tensor, mask_unseen: bool,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    sums, seen = _empty(reference, depths)
    inputs = _arrays(reference, source, matrices, offsets, depths, smallest)
    in_threads(kernels.correlate, *inputs, mask_unseen, *_arrays(sums, seen))
    return sums, seen


@torch.library.register_fake(_correlate)  # type: ignore[untyped-decorator]
def _(
    reference: Tensor, source: Tensor, matrices: Tensor, offsets: Tensor, depths: Tensor, smallest: Tensor, mask_unseen: bool,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    return _empty(reference, depths)


@operation
def _correlate_backward(
    reference: Tensor, source: Tensor, matrices: Tensor, offsets: Tensor, depths: Tensor, smallest: Tensor, mask_unseen: bool,
    grad: Tensor,
) -> tuple[Tensor, Tensor]:  # fmt: skip
    d_reference, d_source = torch.zeros_like(reference), torch.zeros_like(source)
    inputs = _arrays(reference, source, matrices, offsets, depths, smallest)
    outputs = _arrays(grad, d_reference, d_source)
    in_threads(kernels.correlate_backward, *inputs, mask_unseen, *outputs)
    return d_reference, d_source


@torch.library.register_fake(_correlate_backward)  # type: ignore[untyped-decorator]
def _(reference: Tensor, source: Tensor, *others: Any) -> tuple[Tensor, Tensor]:
    return torch.empty_like(reference), torch.empty_like(source)


def _setup(ctx: Any, inputs: tuple[Any, ...], output: tuple[Tensor, Tensor]) -> None:
    *tensors, ctx.mask_unseen = inputs
    ctx.save_for_backward(*tensors)


def _backward(ctx: Any, grad: Tensor, _: Tensor) -> tuple[Tensor | None, ...]:
    d_reference, d_source = _correlate_backward(*ctx.saved_tensors, ctx.mask_unseen, grad)
    return d_reference, d_source, None, None, None, None, None


torch.library.register_autograd(_correlate, _backward, setup_context=_setup)


def _empty(reference: Tensor, depths: Tensor) -> tuple[Tensor, Tensor]:
    """Memory for the sums and for whether points are seen."""
    n, h, w, _ = reference.shape
    sums = reference.new_empty(n, depths.shape[1], h, w)
    return sums, torch.empty_like(sums)


def _arrays(*tensors: Tensor) -> tuple[Any, ...]:
    return tuple(tensor.detach().contiguous().numpy() for tensor in tensors)
