"""Options of all commands that open scenes: what the files may not state."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from semgs.data.paper_variants import check_readings
from semgs.data.scene_details import SceneDetails
from semgs.files.paths import existing_folder
from semgs.run.options.types import optional
from semgs.run.usage_errors import what_the_user_gave


@dataclass(frozen=True)
class SceneOptions:
    """Details that the files may not state. You rarely need these."""

    camera: Annotated[str | None, optional("TOPIC")] = None
    """ROS bags: topic prefix of the camera to use, such as /camera/color."""
    world: Annotated[str | None, optional("FRAME")] = None
    """ROS bags: frame for the poses (map, odom), or the topic to read them from."""
    body: Annotated[str | None, optional("FRAME")] = None
    """ROS bags: the frame that a PoseStamped topic describes; by default the camera's."""
    intrinsics: Annotated[tuple[float, float, float, float] | None, optional("FX FY CX CY")] = None
    """RGB-D frames, Replica, phone captures and ROS bags: fx fy cx cy of the full-size images, in pixels; the image centre is (W/2, H/2).
    Overrides the files."""
    depth_unit: Annotated[float | None, optional("METRES")] = None
    """RGB-D frames and transforms.json: metres per unit of the depth maps, such as 0.001."""
    images: Annotated[Path | None, optional("DIR")] = None
    """COLMAP models: the folder that the names of the images are relative to, if it is not beside the model."""
    unit: Annotated[Literal["metric", "unknown"] | None, optional("{metric,unknown}")] = None
    """Whether lengths are metres, if the files do not say so or are wrong about it."""
    as_peers: Annotated[tuple[str, ...], optional("NAME [NAME ...]")] = ()
    """Read files the way another paper's code does: rows-972 and gsnerf-labels (ScanNet), toolbox-undistortion (ScanNet++),
    row-229.5 (Replica); see docs/reproduce.md."""

    def check(self) -> None:
        """Check the options before a scene is opened.

        Raises:
            UsageError: a number is invalid, or an --as-peers name is unknown.
        """
        _ = self.asked
        with what_the_user_gave():
            check_readings(self.as_peers)

    @cached_property
    def asked(self) -> SceneDetails:
        """The options as readers take them, converted once.

        Raises:
            UsageError: a number is invalid.
        """
        with what_the_user_gave():
            images = None if self.images is None else existing_folder(self.images, "a folder of images")
            return SceneDetails(self.camera, self.world, self.body, self.intrinsics, self.depth_unit, images, self.unit)
