"""`semgs recipe`: the three trainings that the included weights come from, one after the other."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from semgs.cli.commands.networks.training_runs import deadline, train_or_resume
from semgs.cli.options.execution_options import ExecutionOptions
from semgs.cli.options.types import Count, Size, optional
from semgs.cli.usage_errors import UsageError, what_the_user_gave
from semgs.training.data.data_sources import ROOMS
from semgs.training.recipe_stages import STAGES, Start, folder, settings_of, weights_of


@dataclass(frozen=True)
class Recipe:
    """Train the way the included weights were trained: classes, then depth, then colour.

    Each stage is a run as from semgs train, and starts from the weights of the one before.
    - OUT/1_classes: what things look like, from single images
    - OUT/2_depth: how far things are, from two to four views and true depth, without rendering
    - OUT/3_joint: colour and opacity, from rendered views

    To resume, repeat the command. The result is OUT/3_joint/weights.safetensors.

    Examples
    - semgs rooms data/rooms --scenes 1500 --frames 8 --size 240x320
    - semgs recipe small --out runs/recipe --data data/rooms --backbone deeplabv3plus_mobilenet_v2_ade32.safetensors
    - semgs recipe small --out runs/trial --data data/rooms --share 0.05
    - semgs recipe small --out runs/recipe --data data/rooms --stage depth
    """

    model: Annotated[Literal["small", "base"], tyro.conf.Positional, tyro.conf.arg(metavar="{small,base}")]
    """The network. Only small has been trained this way."""
    out: Annotated[Path, tyro.conf.arg(metavar="OUT")]
    """Folder for the three run folders."""
    data: Annotated[tuple[str, ...], tyro.conf.arg(metavar="SOURCE [SOURCE ...]")] = (ROOMS,)
    """Where scenes come from, as for semgs train: rooms, or folders of scenes with labels and depth, with at least six frames each."""
    validation: Annotated[str, tyro.conf.arg(metavar="SOURCE")] = ROOMS
    """Validation scenes: rooms, or a folder of scenes that you do not train on."""
    assets: Annotated[tuple[str, ...], tyro.conf.UseAppendAction, optional()] = ()
    """Folder of meshes and images for the rooms; see semgs rooms --help. Repeatable."""
    init: Annotated[str, optional()] = ""
    """Where colour and depth start: included weights, a file, or random. By default small starts from the included weights, base from random
    ones."""
    backbone: Annotated[str, optional("FILE")] = ""
    """Published MobileNetV2 weights to start the class backbone from; see docs/train.md."""
    teacher: Annotated[str, optional("DIR")] = ""
    """Folder with another network's class probabilities for the training images, from scripts/teach.py."""
    seed: int = 0
    """Random seed of the first stage; each further stage adds one."""
    size: Size = (240, 320)
    """Height and width of the images; the first two stages begin at half the size."""
    share: float = 1.0
    """Share of each stage's steps; 0.05 is a quick trial."""
    stage: Literal["all", "classes", "depth", "joint"] = "all"
    """Run only this stage."""
    nodes: Count = 1
    """Machines, each with that many --devices, started by torchrun or SLURM."""
    compute: Annotated[ExecutionOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=ExecutionOptions)

    def run(self) -> None:
        """Train or resume the stages in order, until all are finished or time is up.

        Raises:
            InputError: a folder, the data or the initial weights cannot be used.
            UsageError: the settings are invalid, an earlier stage is not finished, or training failed.
        """
        with what_the_user_gave():
            start = Start(
                self.model, self.data, self.validation, self.assets, self.seed, self.init, self.backbone, self.teacher, self.size,
                self.share,
            )  # fmt: skip
        stages = STAGES if self.stage == "all" else (self.stage,)
        with what_the_user_gave():
            settings = {stage: settings_of(stage, start, self.out) for stage in stages}
        execution, ends = self.compute.execution(self.nodes), deadline(self.compute.minutes)
        self._check_earlier(stages[0])
        for stage in stages:
            run = folder(self.out, stage)
            with what_the_user_gave():
                execution.share().check(settings[stage].batch)
            if not train_or_resume(f"stage {stage}: {run}", run, settings[stage], execution, ends):
                print(f"stopped: stage {stage} is not finished; repeat the command to resume")
                return
        print(f"finished: {weights_of(self.out, stages[-1])}")

    def _check_earlier(self, stage: str) -> None:
        """Refuse a stage whose predecessor is not finished."""
        from semgs.training.run.run_folder import SETTINGS, is_finished

        place = STAGES.index(stage)
        if not place:
            return
        before = folder(self.out, STAGES[place - 1])
        if not (before / SETTINGS).is_file() or not is_finished(before):
            raise UsageError(f"--stage {stage}: stage {STAGES[place - 1]} in {before} is not finished; run it first")
