"""Options of commands that give Gaussians features."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from semgs.files.errors import InputError
from semgs.files.paths import found_at
from semgs.run.options.types import optional

if TYPE_CHECKING:
    from semgs.data.scene import Scene
    from semgs.segmenters.features.scene_features import Featuring


@dataclass(frozen=True)
class FeatureOptions:
    """Features from any network, to search the scene with semgs query."""

    features: Annotated[Path | None, optional("DIR")] = None
    """Give the Gaussians features: DIR/FRAME.npy (or .npz) has those of an input photo, [numbers height width], of any floating-point type;
    see docs/segmenters.md. They are compressed to at most 32 numbers for each Gaussian and made consistent between the input views."""

    def check(self) -> None:
        """Check what can be checked without importing torch.

        Raises:
            InputError: there is no such folder.
        """
        if self.features is not None and not self.features.is_dir():
            raise InputError(self.features, "a folder of feature maps", found_at(self.features))

    def featuring(self, scene: Scene) -> Featuring | None:
        """What gives the Gaussians of a scene their features; None without the option.

        Raises:
            InputError: there is no such folder.
        """
        if self.features is None:
            return None
        from semgs.segmenters.features.feature_files import FeatureFiles
        from semgs.segmenters.features.scene_features import Featuring

        return Featuring(FeatureFiles.opened(self.features, scene))
