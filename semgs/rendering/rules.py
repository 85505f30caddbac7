"""The rules of splatting for all back-ends: those of gsplat 1.5.3, so that images agree between machines.

The numbers are compiled into the Numba kernels. Their cache only watches the kernels' own files, so touch those after a change here.
"""

from __future__ import annotations

BLUR_PX2 = 0.3
"""Added to the diagonal of a projected covariance: no Gaussian is thinner than about half a pixel [px^2]."""

MAX_ALPHA = 0.999
"""No Gaussian is fully opaque, so that the backward pass can divide by 1 - alpha."""

MIN_ALPHA = 1 / 255
"""Fainter contributions are skipped: they would not change an 8-bit image."""

MIN_TRANSMITTANCE = 1e-4
"""A pixel is finished before the Gaussian that would bring its transmittance down to this; that one is not added."""

CLAMP_MARGIN = 0.15
"""In the Jacobian, x/z and y/z are clamped to the image extended by this fraction of its size on each side: far outside
the image, the linearised projection would stretch a Gaussian without bound."""

NEAR_FRACTION = 0.2
"""With a near bound, Gaussians closer than this fraction of it are not rendered."""

MEDIAN_FRACTION = 0.02
"""Without a near bound, Gaussians closer than this fraction of the median depth in front of the camera are not rendered."""
