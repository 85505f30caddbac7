"""How a training is run: what may change from one session of a run to the next, and the engine, Lightning Fabric, which runs one loop on any device, number of processes
and precision. torch and Fabric are imported by `launch` alone."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

from semgs.files.errors import needs_extra


@dataclass(frozen=True)
class Execution:
    """How a session of a training is run. It changes numbers by rounding at most.

    Attributes:
        device: where to compute, "cpu" or "cuda".
        devices: processes on this machine, which share the scenes of each step.
        nodes: machines, each with that many processes.
        precision: of the layers: "float32", "bf16", or "auto" for bf16 on GPUs that support it.
        accumulate: pieces that each process splits its scenes of a step into, to save memory.
        minutes: stop after this time, with a checkpoint; None runs to the last step.
        workers: processes that prepare batches, for each process that trains; 0 prepares them between steps.
        save_minutes: time between checkpoints.
        cache_gib: memory in which each of these workers keeps images of scenes in folders that it has decoded [GiB].
    """

    device: str = "cpu"
    devices: int = 1
    nodes: int = 1
    precision: str = "float32"
    accumulate: int = 1
    minutes: float | None = None
    workers: int = 1
    save_minutes: float = 5.0
    cache_gib: float = 0.0

    def share(self, rank: int = 0) -> Share:
        """The share of one process."""
        return Share(rank, self.devices * self.nodes, self.accumulate)


@dataclass(frozen=True)
class Share:
    """The scenes of a step that one process takes, and in how many pieces.

    Attributes:
        rank: number of the process.
        world: number of processes.
        accumulate: pieces, computed one after the other; their gradients are added.
    """

    rank: int = 0
    world: int = 1
    accumulate: int = 1

    def check(self, batch: int) -> None:
        """Refuse a batch that cannot be shared equally.

        Raises:
            ValueError: it cannot.
        """
        parts = self.world * self.accumulate
        if self.accumulate < 1 or batch % parts:
            raise ValueError(
                f"a step of {batch} scenes cannot be shared by {self.world} processes in {self.accumulate} pieces each; "
                f"expected a --batch that {parts} divides"
            )

    def pieces(self, step: int, batch: int) -> list[range]:
        """The numbers of the samples of each piece."""
        each = batch // (self.world * self.accumulate)
        first = step * batch + self.rank * self.accumulate * each
        return [range(first + piece * each, first + (piece + 1) * each) for piece in range(self.accumulate)]


def launch(execution: Execution) -> Any:
    """Start the processes of a training. Returns a running Fabric, with `setup_module`, `backward`, `no_backward_sync`, `all_reduce`, `broadcast`, `is_global_zero`.

    With more than one device it starts the other processes of this machine by calling the same command again, unless
    torchrun or SLURM started them. Gradients are averaged over all processes (DDP).

    Whatever the precision of the layers, cameras, depth, Gaussians and losses are float32 or better.

    Raises:
        ImportError: Lightning Fabric is not installed; the message names the extra.
    """
    import torch

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
        from semgs.rendering.gsplat_backend import rasterizer

        rasterizer()  # compiled before there are other processes
    fabric.launch()
    return fabric
