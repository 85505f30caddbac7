"""Options of commands that read scenes, and of those that take photos without poses: what the files, or the photos, may not show."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from semgs.data.paper_variants import check_readings
from semgs.data.scene_details import SceneDetails
from semgs.files.paths import existing_folder
from semgs.run.options.types import at_least
from semgs.run.options.words import one_word, optional, several
from semgs.run.usage_errors import UsageError, what_the_user_gave

if TYPE_CHECKING:
    from semgs.sfm.scene_folder import PhotoDetails


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
    unit: Annotated[Literal["metric", "unknown"] | None, optional()] = None
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


@dataclass(frozen=True)
class PosingOptions:
    """Photos without poses: details that help to estimate the cameras."""

    focal: Annotated[float | None, one_word("PX", at_least(0.0, more=True, finite=True)), optional()] = None
    """Focal length in pixels of the full-size photos. By default it is from EXIF, or solved for, or with two photos a guess."""
    scale_from: Annotated[tuple[str, ...], several("A B METRES", str), optional()] = ()
    """Distance in metres between the cameras of photos A and B, such as 0001.jpg 0004.jpg 1.25. Without it the unit of length is unknown."""
    clip_frames: Annotated[int, one_word("INT", at_least(2))] = 24
    """Largest number of frames to use from a clip."""

    @property
    def given(self) -> bool:
        """Whether an option was given."""
        return self != PosingOptions()

    def known(self) -> PhotoDetails:
        """The options as the estimation takes them.

        Raises:
            UsageError: --scale-from is not two photos and a distance.
        """
        from semgs.sfm.scale import KnownDistance
        from semgs.sfm.scene_folder import PhotoDetails

        if not self.scale_from:
            return PhotoDetails(self.focal, None, self.clip_frames)
        words = self.scale_from[0].split() if len(self.scale_from) == 1 else list(self.scale_from)
        if len(words) != 3:
            raise UsageError(f"--scale-from: expected two photos and a distance in metres, found {' '.join(words)!r}")
        try:
            metres = float(words[2])
        except ValueError as error:
            raise UsageError(
                f"--scale-from: expected a distance in metres after two photos, found {words[2]!r}"
            ) from error
        with what_the_user_gave():
            return PhotoDetails(self.focal, KnownDistance(words[0], words[1], metres), self.clip_frames)
