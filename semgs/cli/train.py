"""`semgs train`: a preset and what to change of it in, a run folder with checkpoints and weights out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from semgs.cli.device import check_device, chosen_device
from semgs.cli.errors import UsageError, what_the_user_gave
from semgs.training import presets
from semgs.training.settings import TrainingSettings, differences

WEIGHTS = "weights.safetensors"

PresetSettings = (
    Annotated[
        TrainingSettings, tyro.conf.subcommand("small", default=presets.small(), description=presets.small.__doc__)
    ]
    | Annotated[
        TrainingSettings, tyro.conf.subcommand("base", default=presets.base(), description=presets.base.__doc__)
    ]
)
"""A preset's name, then what shall differ from it."""


@tyro.conf.configure(tyro.conf.CascadeSubcommandArgs, tyro.conf.OmitSubcommandPrefixes)
@dataclass(frozen=True)
class Train:
    """Train a network on synthetic rooms, drawn live from a seed.

    Type a preset, then what shall differ from it: semgs train small --help lists every setting. The same command goes on
    with a run that was interrupted, killed or ended by --minutes; the bits are those of a run that never was.

    RUN holds settings.json, log.jsonl (losses, speed, validation), validation/ (pictures), checkpoints/, and after every
    sitting weights.safetensors, which semgs reconstruct takes as --weights.

    Examples
    - semgs train small --out runs/small
    - semgs train small --out runs/night --steps 40000 --minutes 480
    - semgs train small --out runs/rough --losses.smoothness 0
    """

    settings: Annotated[PresetSettings, tyro.conf.arg(name="")]
    out: Annotated[Path, tyro.conf.arg(metavar="RUN")]
    """Run folder: a new or empty one, or a run of the same settings to go on with."""
    device: Annotated[str, tyro.conf.arg(metavar="{auto,cpu,cuda}")] = "auto"
    """Where to compute; auto takes a CUDA GPU where there is one. Only the CPU gives the same bits in every run."""
    minutes: float | None = None
    """End after this time, with a checkpoint; none ends at the last step."""
    workers: int = 1
    """Processes that prepare scenes ahead; 0 prepares them between the steps."""
    save_minutes: float = 5.0
    """Minutes between checkpoints."""

    def run(self) -> None:
        """Train, then write the averaged weights and say what to do with them.

        Raises:
            InputError: the folder or the weights to start from cannot be used.
            UsageError: the settings cannot be, training broke down, or an extra that rooms need is not installed.
        """
        if self.workers < 0 or self.save_minutes < 0 or (self.minutes is not None and self.minutes <= 0):
            raise UsageError("--workers and --save-minutes must not be negative, and --minutes must be positive")
        check_device(self.device)
        from rich.console import Console

        console = Console(stderr=True, highlight=False)
        reference = presets.PRESETS[self.settings.model]()
        for name, (value, default) in differences(self.settings, reference).items():
            console.print(f"{name}: {value} (preset {self.settings.model}: {default})", markup=False, soft_wrap=True)
        from semgs.training.loop import train
        from semgs.training.run import claim, export_weights

        device = chosen_device(self.device)
        with what_the_user_gave():
            claim(self.out, self.settings)
        try:
            outcome = train(
                self.settings, self.out, device=device, minutes=self.minutes, workers=self.workers,
                save_minutes=self.save_minutes, console=console,
            )  # fmt: skip
        except (FloatingPointError, ImportError) as error:
            raise UsageError(str(error)) from error
        weights = export_weights(self.out, self.out / WEIGHTS)
        console.print(
            f"step {outcome.step} of {self.settings.steps}, {outcome.skipped} skipped; weights: {weights}",
            soft_wrap=True,
        )
        if not outcome.finished:
            console.print("the same command goes on from here")
