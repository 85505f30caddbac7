"""`semgs train`: trains with a preset and changes to it, and writes a run folder with checkpoints and weights."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, ClassVar

from semgs.cli.options.training_options import ExecutionOptions, TypedSettings
from semgs.run.options.types import Count
from semgs.run.options.words import INLINE, Words
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs.training.presets import PRESETS


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

    presets: ClassVar = PRESETS

    settings: Annotated[TypedSettings, INLINE]
    out: Annotated[Path, Words(metavar="RUN")]
    """Run folder: new, empty, one whose run has no checkpoint yet, or a run with the same settings to resume. You may then raise --steps, move files
    and folders without renaming them, and change how to compute (--device, --devices, --nodes, --precision, --accumulate, --minutes,
    --workers, --save-minutes, --cache-gib)."""
    nodes: Count = 1
    """Machines, each with that many --devices, started by torchrun or SLURM."""
    compute: Annotated[ExecutionOptions, INLINE] = field(default_factory=ExecutionOptions)

    def run(self) -> None:
        """Train, and write the averaged weights into the run folder.

        Raises:
            InputError: the folder, the data or the initial weights cannot be used.
            UsageError: the settings are invalid, training failed, or an extra that rooms need is not installed.
        """
        with what_the_user_gave():
            self.settings.check_complete()
        from rich.console import Console

        from semgs.training.data.room_source import room_source
        from semgs.training.loop import train
        from semgs.training.run.run_folder import claim_folder

        execution = self.compute.execution(self.nodes)
        with what_the_user_gave():
            execution.share().check(self.settings.batch)
        if self.settings.needs_rooms:
            room_source()  # which may not be installed
        claim_folder(self.out, self.settings)
        try:
            train(self.settings, self.out, execution, console=Console(stderr=True, highlight=False))
        except (FloatingPointError, ImportError) as error:
            raise UsageError(str(error)) from error
