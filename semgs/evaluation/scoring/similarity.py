"""How alike two pictures are, beside their PSNR: SSIM, and LPIPS where the user has installed it."""

from __future__ import annotations

import torch
from jaxtyping import Float
from torch import Tensor


def ssim(image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"]) -> float:
    """Structural similarity (Wang et al. 2004) by torchmetrics, the picture clamped to 0..1.

    Gaussian window of 11x11 pixels and standard deviation 1.5, K1 = 0.01, K2 = 0.03; mean over the windows about all pixels,
    mirrored beyond the border, and over the three channels.
    """
    from torchmetrics.functional.image import structural_similarity_index_measure  # takes seconds to import

    value = structural_similarity_index_measure(image.clamp(0, 1)[None], truth[None], data_range=1.0)
    assert isinstance(value, Tensor)
    return float(value)


class PerceptualDistance:
    """LPIPS with VGG features, as pixelSplat and MVSplat report it.

    The package `lpips` is in no extra of ours: it needs torchvision, and fetches weights of its own on first use.

    Raises:
        ImportError: it is not installed.
        OSError: its weights cannot be fetched.
    """

    def __init__(self) -> None:
        import lpips

        self._network = lpips.LPIPS(net="vgg", verbose=False).eval()

    @torch.no_grad()
    def __call__(self, image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"]) -> float:
        """The distance of a picture, clamped to 0..1, from the true one; 0 for equal ones."""
        return float(self._network(image.clamp(0, 1)[None], truth[None], normalize=True))


def perceptual_distance() -> PerceptualDistance | None:
    """LPIPS where it is installed and has its weights, else None."""
    try:
        return PerceptualDistance()
    except (ImportError, OSError):
        return None
