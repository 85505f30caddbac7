"""Options of commands that take photos without poses: what the photos may not show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from semgs.run.options.types import at_least, one_word, optional, several
from semgs.run.usage_errors import UsageError, what_the_user_gave

if TYPE_CHECKING:
    from semgs.sfm.scene_folder import PhotoDetails


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
