"""Options of all commands that open scenes: what a user says of them beyond their files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from semgs.cli.errors import what_the_user_gave

if TYPE_CHECKING:
    from semgs.data.asked import Asked


@dataclass(frozen=True)
class SceneOptions:
    """What the files of a scene leave open. Most leave nothing open."""

    camera: Annotated[str | None, tyro.conf.arg(metavar="TOPIC", help_behavior_hint="")] = None
    """Of a ROS bag with several cameras, the beginning of the topics of one: /camera/color."""
    world: Annotated[str | None, tyro.conf.arg(metavar="FRAME", help_behavior_hint="")] = None
    """Of a ROS bag, the frame that poses are wanted in (map, odom), or the topic that they come from."""
    body: Annotated[str | None, tyro.conf.arg(metavar="FRAME", help_behavior_hint="")] = None
    """Of a ROS bag, the frame that the poses of a PoseStamped topic are of; by default the camera's own."""
    intrinsics: Annotated[
        tuple[float, float, float, float] | None, tyro.conf.arg(metavar="FX FY CX CY", help_behavior_hint="")
    ] = None
    """Focal lengths and principal point of the pictures at their own size in pixels, the middle of WxH being W/2 H/2;
    where no file says them, or to take others."""
    depth_unit: Annotated[float | None, tyro.conf.arg(metavar="METRES", help_behavior_hint="")] = None
    """Metres of one count of the depth maps, such as 0.001, where no file says so."""

    def asked(self) -> Asked:
        """As readers take it.

        Raises:
            UsageError: a number cannot be.
        """
        from semgs.data.asked import Asked

        with what_the_user_gave():
            return Asked(self.camera, self.world, self.body, self.intrinsics, self.depth_unit)
