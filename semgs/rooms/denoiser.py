"""Intel Open Image Denoise: what few samples a pixel leave of noise is taken out; the one place that imports it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from jaxtyping import Float, Float32


def denoise(
    radiance: Float[np.ndarray, "h w 3"],
    colours: Float[np.ndarray, "h w 3"],
    normals: Float[np.ndarray, "h w 3"],
) -> Float32[np.ndarray, "h w 3"]:
    """A picture without its noise.

    Args:
        radiance: linear RGB, noisy.
        colours: of the surfaces, 0..1, without noise.
        normals: of the surfaces, without noise.

    Raises:
        ImportError: pyoidn is not installed; names the extra that brings it.
        RuntimeError: the library reports an error.
    """
    pyoidn, cpu = device()
    images = {"color": radiance, "albedo": colours, "normal": normals, "output": np.zeros_like(radiance)}
    images = {name: np.ascontiguousarray(image, dtype=np.float32) for name, image in images.items()}
    with pyoidn.Filter(cpu, pyoidn.OIDN_FILTER_TYPE_RT) as network:
        for name, image in images.items():
            network.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3)
        network.set_bool("hdr", True)
        network.set_bool("cleanAux", True)
        network.commit()
        network.execute()
    error = cpu.get_error()
    if error is not None:
        raise RuntimeError(f"Open Image Denoise: {error}")
    return images["output"]


@cache
def device() -> tuple[Any, Any]:
    """The library, and a CPU of one thread.

    Raises:
        ImportError: pyoidn is not installed; names the extra that brings it.
    """
    try:
        import pyoidn
    except ImportError as error:
        raise ImportError(
            "tracing rooms needs pyoidn, which is not installed; pip install '.[rooms]' in SemGS's folder"
        ) from error
    cpu = pyoidn.Device(pyoidn.OIDN_DEVICE_TYPE_CPU)
    cpu.set_int("numThreads", 1)
    cpu.set_bool("setAffinity", False)
    cpu.commit()
    return pyoidn, cpu
