"""Intel Open Image Denoise: what few samples a pixel leave of noise is taken out; the one place that imports it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float32


def denoise(
    radiance: Float32[np.ndarray, "h w 3"],
    colours: Float32[np.ndarray, "h w 3"],
    normals: Float32[np.ndarray, "h w 3"],
) -> Float32[np.ndarray, "h w 3"]:
    """A picture without its noise.

    Args:
        radiance: linear RGB, noisy.
        colours: of the surfaces, without noise, 0..1.
        normals: of the surfaces, without noise.

    Raises:
        ImportError: pyoidn is not installed; names the extra that brings it.
        RuntimeError: the library reports an error.
    """
    pyoidn, device = _device()
    result = np.zeros_like(radiance)
    images = {"color": radiance, "albedo": colours, "normal": normals, "output": result}
    images = {name: np.ascontiguousarray(image, dtype=np.float32) for name, image in images.items()}
    with pyoidn.Filter(device, pyoidn.OIDN_FILTER_TYPE_RT) as network:
        for name, image in images.items():
            network.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
        network.set_bool("hdr", True)
        network.set_bool("cleanAux", True)
        network.commit()
        network.execute()
    error = device.get_error()
    if error is not None:
        raise RuntimeError(f"Open Image Denoise: {error}")
    return images["output"]


@cache
def _device() -> tuple[Any, Any]:
    """The library, and a CPU of one thread."""
    try:
        import pyoidn
    except ImportError as error:
        raise ImportError('tracing rooms needs pyoidn, which is not installed; pip install "semgs[rooms]"') from error
    device = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    device.set_int("numThreads", 1)
    device.set_bool("setAffinity", False)
    device.commit()
    return pyoidn, device
