"""Details of a scene that its files may not state, such as which of several cameras to use."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal, get_args

from semgs.files.errors import InputError

Unit = Literal["metric", "unknown"]
"""Of the lengths of a scene: metres, or the scene's own."""

USED_BY = {
    "camera": "a ROS bag",
    "world": "a ROS bag",
    "body": "a ROS bag",
    "intrinsics": "RGB-D frames, Replica, a phone's capture or a ROS bag",
    "depth_unit": "RGB-D frames or a transforms.json",
    "images": "a COLMAP model",
}
"""The layouts that use a detail, in words for messages; `unit` is for all."""


@dataclass(frozen=True)
class SceneDetails:
    """Details given by the user. None leaves a detail to the files.

    Attributes:
        camera: ROS bags: topic prefix of the camera to use ("/camera/color").
        world: ROS bags: frame for the poses ("map"), or the topic to read them from ("/odom").
        body: ROS bags: the frame that a topic's poses describe, if its messages do not say ("base_link").
        intrinsics: fx, fy, cx, cy of the full-size images [px], without distortion, the centre of the first pixel at (0.5, 0.5).
            Overrides the files.
        depth_unit: metres per count of the depth maps [m].
        images: COLMAP models: the folder that the names of the images are relative to, if it is not beside the model.
        unit: of lengths, "metric" or "unknown", for any layout. Overrides the files.

    Raises:
        ValueError: a unit is unknown, or a number is not finite, or not positive where it must be.
    """

    camera: str | None = None
    world: str | None = None
    body: str | None = None
    intrinsics: Sequence[float] | None = None
    depth_unit: float | None = None
    images: Path | None = None
    unit: Unit | None = None

    def __post_init__(self) -> None:
        if self.intrinsics is not None and not (
            len(self.intrinsics) == 4 and all(map(math.isfinite, self.intrinsics)) and min(self.intrinsics[:2]) > 0
        ):
            raise ValueError(f"intrinsics are {self.intrinsics}; expected fx, fy, cx, cy in pixels, fx and fy positive")
        if self.depth_unit is not None and not 0 < self.depth_unit < math.inf:
            raise ValueError(f"depth_unit is {self.depth_unit}; expected metres per count, such as 0.001")
        if self.unit not in (None, *get_args(Unit)):
            raise ValueError(f"unit is {self.unit!r}; expected metric or unknown")

    def only(self, path: Path, layout: str, *takes: str) -> None:
        """Refuse details that a layout does not use, rather than ignore them.

        Raises:
            InputError: a detail is given that is not in `takes`.
        """
        for one in fields(self):
            if getattr(self, one.name) is not None and one.name not in (*takes, "unit"):
                raise InputError(path, USED_BY[one.name], f"layout {layout}", one.name, advice="leave it out")
