"""`semgs train`: trains with a preset and changes to it, and writes a run folder with checkpoints and weights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from semgs.cli.device import chosen_device
from semgs.cli.errors import UsageError, what_the_user_gave
from semgs.cli.training_options import PresetSettings
from semgs.cli.types import Count, Device, Minutes, Workers, at_least, one_word


@tyro.conf.configure(tyro.conf.CascadeSubcommandArgs, tyro.conf.OmitSubcommandPrefixes)
@dataclass(frozen=True)
class Train:
    """Train a network on generated rooms, on your own scenes, or on both.

    Name a preset, then the settings to change; semgs train small --help lists them all. To resume a run that was interrupted, killed
    or stopped by --minutes, repeat the command. On a CPU a resumed run gives exactly the same result as an uninterrupted one.

    RUN contains settings.json, log.jsonl and tensorboard/ (losses, speed, validation), validation/ (images) and checkpoints/. When
    training stops it also gets weights.safetensors, for semgs reconstruct --weights, and best.safetensors.

    Examples
    - semgs train small --out runs/small
    - semgs train small --out runs/night --steps 40000 --minutes 480
    - semgs train small --init small --data rooms=1 scans=3 --out runs/mine
    - semgs train small --init small --classes table.json --data scans --out runs/own
    - semgs train paper --data scannet/train --init re10k.ckpt --devices 4 --out runs/paper
    """

    settings: Annotated[PresetSettings, tyro.conf.arg(name="")]
    out: Annotated[Path, tyro.conf.arg(metavar="RUN")]
    """Run folder: new, empty, or a run with the same settings to resume. Only --steps may change, and only grow."""
    device: Device = "auto"
    """Where to compute; auto uses a CUDA GPU if there is one. Only the CPU gives exactly the same numbers every time."""
    devices: Count = 1
    """GPUs to use on this machine, or CPU processes. They share the scenes of each step."""
    nodes: Count = 1
    """Machines, each with that many devices, started by torchrun or SLURM."""
    precision: Literal["auto", "32", "bf16"] = "32"
    """Precision of the layers: 32, bf16, or auto for bf16 on GPUs that support it. The paper does not state one. Cameras, depth, opacity,
    Gaussians and losses always use float32 or better."""
    accumulate: Count = 1
    """Split each process's share of a step into this many pieces, computed one after the other, to save memory."""
    minutes: Annotated[Minutes, tyro.conf.arg(help_behavior_hint="")] = None
    """Stop after this time, with a checkpoint. The schedule is unchanged. By default training runs to its last step."""
    workers: Workers = 1
    """Processes that load scenes ahead, for each device; 0 loads them between steps."""
    save_minutes: Annotated[float, one_word("FLOAT", at_least(0.0))] = 5.0
    """Minutes between checkpoints."""

    def run(self) -> None:
        """Train, and write the averaged weights into the run folder.

        Raises:
            InputError: the folder, the data or the initial weights cannot be used.
            UsageError: the settings are invalid, training failed, or an extra that rooms need is not installed.
        """
        with what_the_user_gave():
            self.settings.check_whole()
        import torch
        from rich.console import Console

        from semgs.training.execution import Execution
        from semgs.training.loop import train
        from semgs.training.run import claim

        device = chosen_device(self.device)
        if device == "cuda" and self.devices > torch.cuda.device_count():
            raise UsageError(f"--devices {self.devices}: torch finds {torch.cuda.device_count()} CUDA devices here")
        execution = Execution(
            device, self.devices, self.nodes, self.precision, self.accumulate, self.minutes, self.workers, self.save_minutes
        )  # fmt: skip
        with what_the_user_gave():
            execution.share().check(self.settings.batch)
            claim(self.out, self.settings)
        try:
            train(self.settings, self.out, execution, console=Console(stderr=True, highlight=False))
        except (FloatingPointError, ImportError) as error:
            raise UsageError(str(error)) from error
