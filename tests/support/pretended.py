"""A pretended GPU: tensors that say cuda:0, compute on the CPU, and refuse partners that are on it, as real ones do.

    with pretended_device():
        model.to("cuda")(views)

What mixes devices fails here as on a real GPU, on a machine that has none. Kernels of gsplat and of CUDA itself are not run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map

CUDA = torch.device("cuda:0")

MIXING = {
    torch.ops.aten.copy_.default, torch.ops.aten.index.Tensor, torch.ops.aten.index_put_.default, torch.ops.aten.index_put.default,
    torch.ops.aten._index_put_impl_.default,
}  # fmt: skip
"""Operations of which a real GPU takes operands on both devices: copies, and indices on the CPU."""


class Pretended(Tensor):
    """A tensor on the pretended device; `elem` holds its numbers on the CPU. To torch's own core it is a meta tensor, which has no numbers
    and needs no driver; Python code, ours included, is told cuda:0."""

    elem: Tensor

    @staticmethod
    def __new__(cls, elem: Tensor) -> Pretended:
        shape = torch.empty_strided(elem.shape, elem.stride(), dtype=elem.dtype, device="meta")
        self = torch.Tensor._make_subclass(
            cls, shape, elem.requires_grad, dispatch_device=True, device_for_backend_keys=CUDA
        )
        self.elem = elem
        return self

    @property
    def device(self) -> torch.device:  # type: ignore[override]
        return CUDA

    @property
    def is_cuda(self) -> bool:  # type: ignore[override]
        return True

    def __repr__(self, **options: Any) -> str:
        return f"Pretended({self.elem!r})"

    @classmethod
    def __torch_dispatch__(cls, function: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return dispatched(function, args, kwargs or {})


def dispatched(function: Any, args: Any, kwargs: dict[str, Any]) -> Any:
    """Compute on the CPU what is asked of either device, and put the result where it belongs.

    Raises:
        RuntimeError: operands are on both.
    """
    given = [one for one in tree_leaves((args, kwargs)) if isinstance(one, Tensor)]
    there = [one for one in given if isinstance(one, Pretended)]
    here = [one for one in given if not isinstance(one, Pretended) and one.ndim]
    asked = kwargs.get("device")
    if there and here and asked is None and function not in MIXING:
        raise RuntimeError(f"{function}: expected all tensors to be on the same device, found cuda:0 and cpu")
    on_gpu = torch.device(asked).type in ("cuda", "meta") if asked is not None else bool(there)
    if function is torch.ops.aten.copy_.default:
        on_gpu = isinstance(args[0], Pretended)
    if asked is not None:
        kwargs = {**kwargs, "device": torch.device("cpu")}
    args, kwargs = tree_map(lambda one: one.elem if isinstance(one, Pretended) else one, (args, kwargs))
    result = function(*args, **kwargs)
    if not on_gpu:
        return result
    # What was changed in place is returned as what it was.
    known = {id(one.elem): one for one in there}
    return tree_map(lambda one: _wrapped(one, known) if isinstance(one, Tensor) else one, result)


def _wrapped(tensor: Tensor, known: dict[int, Pretended]) -> Pretended:
    """The tensor on the pretended device: the one that it was given as, if it was."""
    there = known.get(id(tensor))
    return Pretended(tensor) if there is None else there


class _Dispatch(TorchDispatchMode):
    """Factories, whose operands are on no device yet."""

    def __torch_dispatch__(self, function: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        return dispatched(function, args, kwargs or {})


class _Moved(torch.autograd.Function):
    """To the pretended device or back, with the gradient going the other way."""

    @staticmethod
    def forward(ctx: Any, tensor: Tensor, there: bool) -> Tensor:
        ctx.there = there
        return Pretended(tensor.detach()) if there else tensor.elem.detach()  # type: ignore[attr-defined]

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (gradient,) = gradients
        return (gradient.elem if ctx.there else Pretended(gradient)), None  # type: ignore[attr-defined]


CASTS = {
    Tensor.float: torch.float32, Tensor.double: torch.float64, Tensor.half: torch.float16, Tensor.bfloat16: torch.bfloat16,
    Tensor.long: torch.int64, Tensor.int: torch.int32, Tensor.bool: torch.bool, Tensor.byte: torch.uint8,
}  # fmt: skip
ALOUD = (
    Tensor.item,
    Tensor.tolist,
    Tensor.__bool__,
    Tensor.__int__,
    Tensor.__float__,
    Tensor.__index__,
    Tensor.__repr__,
    Tensor.__format__,
)
"""What brings numbers to Python, from wherever they are."""


class _Function(TorchFunctionMode):
    """What Python's own bindings would ask CUDA for, before any operation is dispatched."""

    def __torch_function__(self, function: Callable[..., Any], types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = dict(kwargs or {})
        if function in (torch.tensor, torch.as_tensor):
            where = kwargs.pop("device", None)
            made = function(*args, **kwargs)
            return made if where is None else _moved(made, torch.device(where))
        if function is Tensor.to:
            return _to(*args, **kwargs)
        if function in (Tensor.cpu, Tensor.cuda):
            return _moved(args[0], CUDA if function is Tensor.cuda else torch.device("cpu"))
        if not (args and isinstance(args[0], Pretended)):
            return function(*args, **kwargs)
        tensor, *rest = args
        if function is Tensor.numpy:
            raise TypeError("can't convert cuda:0 device type tensor to numpy; use Tensor.cpu() first")
        if function in ALOUD:
            return function(tensor.elem, *rest, **kwargs)
        if function is Tensor.new_tensor:
            made = torch.tensor(*rest, **{"dtype": tensor.dtype, "device": "cpu", **kwargs})
            return _moved(made, CUDA)
        if function in CASTS:
            return _to(tensor, CASTS[function])
        return function(*args, **kwargs)


def _to(tensor: Tensor, *rest: Any, **kwargs: Any) -> Tensor:
    """`tensor.to(...)` in all its forms."""
    where, dtype, layout = kwargs.get("device"), kwargs.get("dtype"), kwargs.get("memory_format")
    for one in (*rest, kwargs.get("other")):
        if isinstance(one, str | torch.device):
            where = one
        elif isinstance(one, Tensor):
            where, dtype = one.device, one.dtype
        elif isinstance(one, torch.dtype):
            dtype = one
    if where is not None:
        tensor = _moved(tensor, torch.device(where))
    if dtype in (None, tensor.dtype) and layout is None:
        return tensor
    return torch.ops.aten._to_copy.default(tensor, dtype=dtype or tensor.dtype, memory_format=layout)


def _moved(tensor: Tensor, where: torch.device) -> Tensor:
    there = where.type == "cuda"
    return tensor if there == isinstance(tensor, Pretended) else _Moved.apply(tensor, there)


@contextmanager
def pretended_device() -> Iterator[torch.device]:
    """Within the block there is one GPU, which is none."""
    before = torch.__future__.get_overwrite_module_params_on_conversion()
    torch.__future__.set_overwrite_module_params_on_conversion(True)
    try:
        with (
            patch("torch.cuda._lazy_init"), patch("torch.cuda.synchronize"), patch("torch.cuda.is_available", return_value=True),
            patch("torch.cuda.memory_allocated", return_value=0), patch("torch.cuda.memory_reserved", return_value=0),
            patch("torch.cuda.mem_get_info", return_value=(10**11, 10**11)), patch("torch.cuda.device_count", return_value=1),
            patch("torch.cuda.get_device_capability", return_value=(7, 0)), patch("torch.cuda.set_device"), patch("torch.cuda.empty_cache"),
            patch("torch.accelerator.is_available", return_value=False),  # optimizers would ask the driver, which may be missing
            _Dispatch(), _Function(),
        ):  # fmt: skip
            yield CUDA
    finally:
        torch.__future__.set_overwrite_module_params_on_conversion(before)
