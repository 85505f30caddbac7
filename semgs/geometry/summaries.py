"""Summaries for the `repr` of types that contain tensors."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor


def describe(kind: str, /, **parts: object) -> str:
    """The name of a type and a line for each part: shape and range of tensors; parts that are None are left out."""
    lines = [
        f"  {key}: {describe_tensor(part) if isinstance(part, Tensor) else str(part).replace(chr(10), chr(10) + '  ')}"
        for key, part in parts.items()
        if part is not None
    ]
    return "\n".join([f"{kind}(", *lines, ")"])


def describe_tensor(tensor: Tensor) -> str:
    """Shape and range, as in "[2 3 240 320] 0 to 1"; also type and device, unless they are float32 and the CPU."""
    said = f"[{' '.join(map(str, tensor.shape))}]"
    if tensor.numel():
        low, high = tensor.detach().aminmax()
        said += f" {low.item():.4g} to {high.item():.4g}"
    if tensor.dtype != torch.float32:
        said += f", {str(tensor.dtype).removeprefix('torch.')}"
    return said if tensor.device.type == "cpu" else f"{said}, on {tensor.device}"


def array_of(tensor: Tensor) -> np.ndarray:
    """A tensor on any device as a float32 array, without gradient."""
    return tensor.detach().to("cpu", torch.float32).numpy()
