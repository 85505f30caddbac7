"""Options of all commands that open scenes: what a user says of them beyond their files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import tyro

from semgs.cli.errors import what_the_user_gave
from semgs.data.asked import Asked
from semgs.data.peers import check_readings


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
    as_peers: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME [NAME ...]", help_behavior_hint="")] = ()
    """Read files as peers do where ours differs: rows-972 and gsnerf-labels (ScanNet), toolbox-undistortion (ScanNet++),
    row-229.5 (Replica); docs/data.md tells what each does."""

    def check(self) -> None:
        """Refuse what can be refused before a scene is opened.

        Raises:
            UsageError: a number cannot be, or there is no reading of a name.
        """
        _ = self.asked
        with what_the_user_gave():
            check_readings(self.as_peers)

    @cached_property
    def asked(self) -> Asked:
        """As readers take it, converted once.

        Raises:
            UsageError: a number cannot be.
        """
        with what_the_user_gave():
            return Asked(self.camera, self.world, self.body, self.intrinsics, self.depth_unit)
