"""The engine: Lightning Fabric, which runs one loop on any device, number of processes and precision. Only imported here."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import torch

from semgs.files.extras import needs_extra
from semgs.rendering.gsplat_backend import rasterizer
from semgs.training.run.execution import Execution


def launch(execution: Execution) -> Any:
    """Start the processes of a training. Returns a running Fabric, with `setup_module`, `backward`, `no_backward_sync`, `all_reduce`, `broadcast`, `is_global_zero`.

    With more than one device it starts the other processes of this machine by calling the same command again, unless
    torchrun or SLURM started them. Gradients are averaged over all processes (DDP).

    Whatever the precision of the layers, cameras, depth, Gaussians and losses are float32 or better.

    Raises:
        ImportError: Lightning Fabric is not installed; the message names the extra.
    """
    with needs_extra("train", "training needs Lightning Fabric", "lightning_fabric"):
        from lightning_fabric import Fabric
        from lightning_fabric.plugins import MixedPrecision, Precision

    class LayersInBfloat16(MixedPrecision):
        """Autocast around the forward pass; inputs and outputs keep their precision."""

        convert_input = Precision.convert_input
        convert_output = Precision.convert_output

    device, several = execution.device, execution.devices * execution.nodes > 1
    precision = execution.precision
    half = precision == "bf16" or (precision == "auto" and device == "cuda" and torch.cuda.is_bf16_supported(False))
    fabric = Fabric(
        accelerator=device,
        devices=execution.devices,
        num_nodes=execution.nodes,
        strategy="ddp" if several else "auto",
        plugins=[LayersInBfloat16("bf16-mixed", device)] if half else None,
    )
    if device == "cuda" and several and find_spec("gsplat"):
        rasterizer()  # compiled before there are other processes
    fabric.launch()
    return fabric
