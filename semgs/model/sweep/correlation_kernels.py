"""Compiled kernels of the plane sweep: bilinear sampling and the product of features in one pass, and its gradient."""

from typing import Any

import numpy as np

from semgs.runtime.jit import njit

Array = np.ndarray[Any, Any]


@njit(error_model="numpy")
def _taps(u: float, v: float, h: int, w: int, mask_unseen: bool) -> tuple[Any, ...]:
    """The four texels around a position and their weights (0 outside the map, unless its border is extended)."""
    left, top = int(np.floor(u)), int(np.floor(v))
    a, b = u - left, v - top
    x0, x1, y0, y1 = left, left + 1, top, top + 1
    wx0, wx1, wy0, wy1 = 1 - a, a, 1 - b, b
    if not mask_unseen:
        if x0 < 0 or x0 >= w:
            wx0 *= 0
        if x1 < 0 or x1 >= w:
            wx1 *= 0
        if y0 < 0 or y0 >= h:
            wy0 *= 0
        if y1 < 0 or y1 >= h:
            wy1 *= 0
    x0, x1 = min(max(x0, 0), w - 1), min(max(x1, 0), w - 1)
    y0, y1 = min(max(y0, 0), h - 1), min(max(y1, 0), h - 1)
    return x0, x1, y0, y1, wx0, wx1, wy0, wy1


@njit(error_model="numpy", nogil=True, fastmath={"contract", "reassoc", "nsz"})
def correlate(
    reference: Array,
    source: Array,
    matrices: Array,
    offsets: Array,
    depths: Array,
    smallest: Array,
    mask_unseen: bool,
    sums: Array,
    seen: Array,
    part: int,
    parts: int,
) -> None:
    """sums[n, l, y, x] = <reference[n, y, x], source sampled at plane l>; seen = 1 where the source sees the point."""
    n, h, w, c = reference.shape
    planes = depths.shape[1]
    for job in range(part * n * h // parts, (part + 1) * n * h // parts):
        i, y = job // h, job % h
        m, o = matrices[i], offsets[i]
        for x in range(w):
            rx = m[0, 0] * x + m[0, 1] * y + m[0, 2]
            ry = m[1, 0] * x + m[1, 1] * y + m[1, 2]
            rz = m[2, 0] * x + m[2, 1] * y + m[2, 2]
            texel = reference[i, y, x]
            for k in range(planes):
                d = depths[i, k]
                z = rz * d + o[2]
                inverse = 1 / max(z, smallest[i])
                u, v = (rx * d + o[0]) * inverse, (ry * d + o[1]) * inverse
                inside = z > smallest[i] and -0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5
                seen[i, k, y, x] = 1 if inside else 0
                if not inside and (mask_unseen or not (-1 < u < w and -1 < v < h)):
                    sums[i, k, y, x] = 0
                    continue
                x0, x1, y0, y1, wx0, wx1, wy0, wy1 = _taps(u, v, h, w, mask_unseen)
                f00, f01, f10, f11 = source[i, y0, x0], source[i, y0, x1], source[i, y1, x0], source[i, y1, x1]
                w00, w01, w10, w11 = wy0 * wx0, wy0 * wx1, wy1 * wx0, wy1 * wx1
                total = sums.dtype.type(0)
                for j in range(c):
                    total += texel[j] * (w00 * f00[j] + w01 * f01[j] + w10 * f10[j] + w11 * f11[j])
                sums[i, k, y, x] = total


@njit(error_model="numpy", nogil=True, fastmath={"contract", "reassoc", "nsz"})
def correlate_backward(
    reference: Array,
    source: Array,
    matrices: Array,
    offsets: Array,
    depths: Array,
    smallest: Array,
    mask_unseen: bool,
    grad: Array,
    d_reference: Array,
    d_source: Array,
    part: int,
    parts: int,
) -> None:
    """Gradients of `correlate` in both feature maps, added to zeros; each pair is one job, so no writes race."""
    n, h, w, c = reference.shape
    planes = depths.shape[1]
    for i in range(part, n, parts):
        m, o = matrices[i], offsets[i]
        for y in range(h):
            for x in range(w):
                rx = m[0, 0] * x + m[0, 1] * y + m[0, 2]
                ry = m[1, 0] * x + m[1, 1] * y + m[1, 2]
                rz = m[2, 0] * x + m[2, 1] * y + m[2, 2]
                texel, d_texel = reference[i, y, x], d_reference[i, y, x]
                for k in range(planes):
                    g = grad[i, k, y, x]
                    if g == 0:
                        continue
                    d = depths[i, k]
                    z = rz * d + o[2]
                    inverse = 1 / max(z, smallest[i])
                    u, v = (rx * d + o[0]) * inverse, (ry * d + o[1]) * inverse
                    inside = z > smallest[i] and -0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5
                    if not inside and (mask_unseen or not (-1 < u < w and -1 < v < h)):
                        continue
                    x0, x1, y0, y1, wx0, wx1, wy0, wy1 = _taps(u, v, h, w, mask_unseen)
                    f00, f01, f10, f11 = source[i, y0, x0], source[i, y0, x1], source[i, y1, x0], source[i, y1, x1]
                    w00, w01, w10, w11 = g * wy0 * wx0, g * wy0 * wx1, g * wy1 * wx0, g * wy1 * wx1
                    for j in range(c):
                        d_texel[j] += w00 * f00[j] + w01 * f01[j] + w10 * f10[j] + w11 * f11[j]
                    for y_tap, x_tap, weight in ((y0, x0, w00), (y0, x1, w01), (y1, x0, w10), (y1, x1, w11)):
                        d_tap = d_source[i, y_tap, x_tap]
                        for j in range(c):
                            d_tap[j] += weight * texel[j]
