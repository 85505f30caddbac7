"""Options of commands that take depth maps from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from semgs.files.paths import typed_path
from semgs.run.options.words import Words, optional
from semgs.run.usage_errors import UsageError

if TYPE_CHECKING:
    from semgs.data.scene import Scene
    from semgs.depth_maps.depth_source import DepthMaps
    from semgs.depth_maps.sensor_depth import DepthSource
    from semgs.runtime.stopwatch import Stages

OWN, SENSOR = "maps", "sensor"
MEASURED: tuple[DepthSource, ...] = ("network", "sensor", "both")

DepthMeaning = Annotated[Literal["metric", "scaled", "inverse"] | None, optional()]
"""What the numbers of depth maps are."""


@dataclass(frozen=True)
class DepthOptions:
    """Where the Gaussians' depth comes from."""

    depth: Annotated[str, Words(metavar="{network, sensor, both, maps, SOURCE}")] = "network"
    """Where the Gaussians' depth comes from: the network; the frames' measured depth maps (sensor), at least half of whose pixels must be known; or
    both, weighted by their uncertainty. Or the network and depth maps of unknown scale: the frames' own (maps), or those of SOURCE: a folder of depth
    maps, an exported network (.onnx, .tflite), a model folder of transformers, or hf:OWNER/NAME. They are aligned to the scene; see docs/segmenters.md."""
    depth_meaning: DepthMeaning = None
    """What the numbers of --depth maps or SOURCE are: metres, depth up to a factor, or inverse depth up to a factor and a constant (MiDaS, Depth Anything
    V2). By default what SOURCE says; maps are scaled."""

    @property
    def inputs(self) -> tuple[str, ...]:
        """The files and folders to read."""
        return () if self.depth in (*MEASURED, OWN) else (self.depth,)

    def check(self) -> None:
        """Check what can be checked without importing torch.

        Raises:
            UsageError: there is no such source, or the meaning of measured depth is given.
        """
        known = (*MEASURED, OWN)
        if self.depth not in known and not self.depth.startswith("hf:") and not typed_path(self.depth).exists():
            from semgs.files.text import did_you_mean

            raise UsageError(
                f"--depth is {self.depth}{did_you_mean(self.depth, known)}; expected {', '.join(known)}, a folder of depth maps, "
                "an exported network (.onnx, .tflite), a model folder of transformers, or hf:OWNER/NAME"
            )
        if self.depth_meaning is not None and self.depth in MEASURED:
            raise UsageError("--depth-meaning is for --depth maps or SOURCE")

    def source(self, scene: Scene, stages: Stages) -> DepthSource | DepthMaps:
        """The source of depth, for the frames of a scene; a network is loaded as a stage.

        Raises:
            InputError: it cannot be used.
            ImportError: the library that runs it is not installed.
        """
        for measured in MEASURED:
            if self.depth == measured:
                return measured
        from semgs.depth_maps.opening import open_depth_maps

        with stages("load", f"Opening {self.depth}"):
            return open_depth_maps(self.depth, self.depth_meaning)(scene)
