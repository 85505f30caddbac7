"""Where a function of PyTorch operations is not smooth: how far its numbers are from thresholds, ties, kinks and clamps."""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor
from torch.overrides import TorchFunctionMode


class Kinks(TorchFunctionMode):
    """Keeps, of every operation with a kink that runs inside it, the signed distances of its numbers from that kink.

    ReLU and absolute value bend at 0, clamps at their limits, a maximum where two are largest, a comparison jumps where
    both sides are equal, and an order changes where two neighbours are.
    """

    def __init__(self) -> None:
        super().__init__()
        self.distances: list[Tensor] = []

    def __torch_function__(self, func: Callable, types: object, args: tuple = (), kwargs: dict | None = None) -> object:
        kwargs = kwargs or {}
        name = getattr(func, "__name__", "").strip("_")
        numbers = [one for one in args if isinstance(one, Tensor | float | int)]
        if args and isinstance(args[0], Tensor) and args[0].is_floating_point():
            x = args[0].detach()
            if name in ("relu", "abs", "absolute"):
                self.distances.append(x)
            elif name in ("clamp", "clamp_min", "clip"):
                for limit in (*numbers[1:], *(kwargs[key] for key in ("min", "max") if key in kwargs)):
                    self.distances.append(x - limit)
            elif name in ("gt", "ge", "lt", "le"):
                self.distances.append(x - numbers[1])
            elif name == "amax":
                dim = args[1] if len(args) > 1 else kwargs.get("dim")
                first, second = (x.flatten() if dim is None else x.movedim(dim, -1)).topk(2).values.unbind(-1)
                self.distances.append(first - second)
            elif name == "argsort":
                self.distances.append(x.sort().values.diff())
        return func(*args, **kwargs)
