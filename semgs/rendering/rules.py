"""The rules of splatting that every back-end follows: gsplat 1.5.3's, so that pictures agree between machines.

The numbers are compiled into the Numba kernels, whose cache watches their own files alone: touch those when one changes.
"""

from __future__ import annotations

BLUR_PX2 = 0.3
"""Added to the diagonal of a projected covariance: no Gaussian is thinner than about half a pixel [px^2]."""

MAX_ALPHA = 0.999
"""No Gaussian hides all that lies behind it, so that the backward pass may divide by 1 - alpha."""

MIN_ALPHA = 1 / 255
"""Fainter contributions are skipped: they would not change an 8-bit picture."""

MIN_TRANSMITTANCE = 1e-4
"""A pixel is finished before the Gaussian that would bring its transmittance down to this; that one is not added."""

CLAMP_MARGIN = 0.15
"""In the Jacobian alone, x/z and y/z are clamped to the image widened by this part of its size on each side: far outside
the picture the linearised projection would stretch a Gaussian without bound."""

NEAR_FRACTION = 0.2
"""With a near bound given, what is closer than this part of it is not drawn."""

MEDIAN_FRACTION = 0.02
"""Without a near bound, what is closer than this part of the median depth in front of the camera is not drawn."""
