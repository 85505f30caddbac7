"""Settings of the augmentation: which random changes, and how strong. No torch."""

from __future__ import annotations

from dataclasses import dataclass

from semgs.training.setting_checks import check_values


@dataclass(frozen=True)
class Augmentation:
    """Random changes to a sample. All but `exposure` are the same for all of its views and their cameras."""

    colour: float = 0.0
    """Change exposure, white balance and saturation by factors of up to exp(this). 0.2 is strong."""
    crop: float = 1.0
    """Random crop: shortest side of the window, relative to the image. The camera follows. 1 does not crop."""
    flip: bool = False
    """Mirror every second sample, with its cameras (MVSplat's)."""
    roll: float = 0.0
    """Rotate every second sample about the optical axis, by up to this many degrees either way. Needs --supervision pictures, because the
    corners are filled with the mirrored image (label 255)."""
    camera: float = 0.0
    """Imitate a photo camera: blur, vignetting, white balance, noise, gamma, JPEG and, in one sample of ten, grey. 1 is as strong as on
    phones."""
    exposure: float = 0.0
    """Change the exposure, white balance and saturation of each view by itself, by factors of up to exp(this), as a camera on automatic does.
    Not with --supervision rendered, which compares the views' colours."""

    def __post_init__(self) -> None:
        bounds = {"colour": (0, 1), "crop": (0.2, 1), "roll": (0, 45), "camera": (0, 1), "exposure": (0, 1)}
        checks = {
            name: (low <= getattr(self, name) <= high, f"{low} to {high}") for name, (low, high) in bounds.items()
        }
        check_values(self, **checks)
