"""Similarity of two images besides PSNR: SSIM, and LPIPS if the user has installed it."""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float
from torch import Tensor


def ssim(
    image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"], shown: Bool[Tensor, "h w"] | None = None
) -> float:
    """Structural similarity (Wang et al. 2004) by torchmetrics; the image is clamped to 0..1.

    Gaussian window of 11x11 pixels with standard deviation 1.5, K1 = 0.01, K2 = 0.03. Mean over the windows around all pixels,
    mirrored at the border, and over the three channels.

    Args:
        image, truth: to compare.
        shown: pixels whose windows count; None is all.
    """
    from torchmetrics.functional.image import structural_similarity_index_measure  # takes seconds to import

    images = image.clamp(0, 1)[None], truth[None]
    if shown is not None:
        _, maps = structural_similarity_index_measure(*images, data_range=1.0, return_full_image=True)
        return float(maps[0][:, shown].mean())
    value = structural_similarity_index_measure(*images, data_range=1.0)
    assert isinstance(value, Tensor)
    return float(value)


class PerceptualDistance:
    """LPIPS with VGG features, as pixelSplat and MVSplat report it.

    The package `lpips` is in none of our extras: it needs torchvision, and downloads its own weights on first use.

    Raises:
        ImportError: it is not installed.
        OSError: its weights cannot be downloaded.
    """

    def __init__(self) -> None:
        import lpips

        self._network = lpips.LPIPS(net="vgg", verbose=False).eval()

    @torch.no_grad()
    def __call__(self, image: Float[Tensor, "3 h w"], truth: Float[Tensor, "3 h w"]) -> float:
        """The distance of an image, clamped to 0..1, from the true one; 0 if they are equal."""
        return float(self._network(image.clamp(0, 1)[None], truth[None], normalize=True))


def perceptual_distance() -> PerceptualDistance | None:
    """LPIPS if it is installed with its weights, else None."""
    try:
        return PerceptualDistance()
    except (ImportError, OSError):
        return None
