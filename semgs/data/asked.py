"""What a user says of a scene beyond its files: which of several cameras, or what the files leave open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from semgs.files.errors import InputError


@dataclass(frozen=True)
class Asked:
    """Answers to what a layout may leave open; None leaves it to the layout.

    Attributes:
        camera: which of a recording's cameras, by the beginning of its topics ("/camera/color").
        world: the frame that poses are wanted in ("map"), or the topic that they come from ("/odom").
        body: the frame that such a topic's poses are of, where its messages do not say ("base_link").
        intrinsics: fx, fy, cx, cy of the pictures at their own size [px], the centre of the first pixel at (0.5, 0.5), without
            distortion; in place of what the layout says or has no word for.
        depth_unit: what one count of the depth maps is worth [m].

    Raises:
        ValueError: a number is not finite, or one that has to be positive is not.
    """

    camera: str | None = None
    world: str | None = None
    body: str | None = None
    intrinsics: Sequence[float] | None = None
    depth_unit: float | None = None

    def __post_init__(self) -> None:
        if self.intrinsics is not None and not (
            len(self.intrinsics) == 4 and all(map(math.isfinite, self.intrinsics)) and min(self.intrinsics[:2]) > 0
        ):
            raise ValueError(f"intrinsics are {self.intrinsics}; expected fx, fy, cx, cy in pixels, fx and fy positive")
        if self.depth_unit is not None and not 0 < self.depth_unit < math.inf:
            raise ValueError(f"depth_unit is {self.depth_unit}; expected the metres of one count, such as 0.001")

    def only(self, path: Path, layout: str, *takes: str) -> None:
        """Refuse answers that a layout does not ask for, rather than pass over them.

        Raises:
            InputError: something else than `takes` is given.
        """
        for one in fields(self):
            if getattr(self, one.name) is not None and one.name not in takes:
                raise InputError(
                    path, f"a layout that leaves {one.name} open", f"layout {layout}, which does not", one.name,
                    advice="leave it out",
                )  # fmt: skip
