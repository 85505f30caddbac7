"""Options of commands that take classes from a segmenter."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from semgs.cli.errors import UsageError

if TYPE_CHECKING:
    from semgs.data.scene import Scene
    from semgs.segmenters.labelling import Labelling


Classes = Annotated[Literal["scannet20", "own"] | None, tyro.conf.arg(help_behavior_hint="")]
"""The table of a segmenter's answers."""


@dataclass(frozen=True)
class SegmenterOptions:
    """Classes from a 2D segmenter instead of the model's own."""

    segmenter: Annotated[str | None, tyro.conf.arg(metavar="SEGMENTER", help_behavior_hint="")] = None
    """Take the classes from a 2D segmenter: a folder of class maps, an exported network (.onnx, .tflite), a model folder of
    transformers, or hf:OWNER/NAME; see docs/segmenters.md. Its answers are made consistent between the input views."""
    classes: Classes = None
    """Classes of the result with --segmenter: ScanNet's 20, found by name, or the segmenter's own. By default class maps keep their own,
    and networks give ScanNet's 20."""
    with_own_classes: bool = False
    """With --segmenter: the model's own classes vote too."""

    def check(self) -> None:
        """Check what can be checked without importing torch.

        Raises:
            UsageError: an option needs --segmenter.
        """
        if self.segmenter is None and (self.classes or self.with_own_classes):
            raise UsageError(f"{'--classes' if self.classes else '--with-own-classes'} is for --segmenter")
        if self.segmenter is not None and self.with_own_classes and self.classes == "own":
            raise UsageError("--with-own-classes needs the model's class table, so it cannot go with --classes own")

    def labelling(self, scene: Scene, save: Path, earlier: Path) -> Labelling | None:
        """What gives the Gaussians of a scene their classes; None without a segmenter.

        Args:
            scene: to reconstruct.
            save: new folder for the maps of a network.
            earlier: folder in which an earlier run may have saved maps.

        Raises:
            InputError: the segmenter cannot be used.
            ImportError: the library that runs it is not installed.
        """
        if self.segmenter is None:
            return None
        from semgs.segmenters.labelling import Labelling
        from semgs.segmenters.opening import sources

        opened = sources(self.segmenter, self.classes, save=save, earlier=earlier)
        return Labelling(opened(scene), own=self.with_own_classes)
