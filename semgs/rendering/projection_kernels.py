"""Numba kernels: from Gaussians to ellipses in the image plane, and from gradients of ellipses to gradients of Gaussians.

All geometry is float64 whatever the dtype of the Gaussians, so that float32 input meets the same decisions (order, 1/255,
finished pixels) as the float64 reference. `camera` is a vector of 20: axes row by row (0..8), centre (9..11), fx, fy, cx, cy
(12..15), lowest and highest x/z (16, 17) and y/z (18, 19) that the Jacobian sees.
"""

from __future__ import annotations

import math

import numpy as np

from semgs.rendering.rules import BLUR_PX2, MIN_ALPHA
from semgs.runtime.jit import njit

CENTRE_X, CENTRE_Y, CONIC_XX, CONIC_XY, CONIC_YY, OPACITY, REACH, DETERMINANT = range(8)
"""Columns of an ellipse: centre [px], inverse covariance [px^-2], opacity, reach (the squared Mahalanobis distance
2 ln(255 opacity) within which alpha is 1/255 or more; negative if there is nothing to render), and the determinant of the
inverse covariance."""

SLACK = 1e-9
"""Added to the reach, so that rounding never loses a pixel that the 1/255 rule, applied afterwards, admits."""

SMALLEST_NORM = 1e-12
"""Quaternions shorter than this are divided by it instead of by their length, as in torch's `normalize`."""


@njit(error_model="numpy", nogil=True)
def project(means, quaternions, scales, opacities, camera, ellipses, part, parts):
    """Fill `ellipses` [g 8]."""
    for i in range(part * len(means) // parts, (part + 1) * len(means) // parts):
        ellipses[i, REACH] = -1.0
        x, y, z = _inside(means, i, camera)
        opacity = np.float64(opacities[i])
        if not (z > 0 and opacity >= MIN_ALPHA):
            continue
        plane = _plane(x, y, z, camera)
        w, qx, qy, qz, _ = _unit(quaternions, i)
        rotation = _rotation(w, qx, qy, qz)
        xx, xy, yy = BLUR_PX2, 0.0, BLUR_PX2
        for k in range(3):
            ax, ay = _axis(plane, rotation, k)
            square = np.float64(scales[i, k]) ** 2
            xx += square * ax * ax
            xy += square * ax * ay
            yy += square * ay * ay
        determinant = xx * yy - xy * xy
        u = camera[12] * x / z + camera[14]
        v = camera[13] * y / z + camera[15]
        if not (determinant > 0 and math.isfinite(determinant) and math.isfinite(u) and math.isfinite(v)):
            continue
        ellipses[i, CENTRE_X] = u
        ellipses[i, CENTRE_Y] = v
        ellipses[i, CONIC_XX] = yy / determinant
        ellipses[i, CONIC_XY] = -xy / determinant
        ellipses[i, CONIC_YY] = xx / determinant
        ellipses[i, OPACITY] = opacity
        ellipses[i, REACH] = 2 * math.log(opacity / MIN_ALPHA) + SLACK
        ellipses[i, DETERMINANT] = 1 / determinant


@njit(error_model="numpy", nogil=True)
def project_backward(
    means, quaternions, scales, camera, ellipses, met, grad_ellipses,
    grad_means, grad_quaternions, grad_scales, grad_opacities, part, parts,
):  # fmt: skip
    """Carry each ellipse's gradients back through the projection.

    Args:
        met: [g], whether an ellipse touches any tile; the gradients of others stay 0.
        grad_ellipses: [g 6], of centre, inverse covariance (xy counted once) and opacity.
        grad_means, grad_quaternions, grad_scales, grad_opacities: zeros, filled.
    """
    for i in range(part * len(means) // parts, (part + 1) * len(means) // parts):
        if not met[i]:
            continue
        vu, vv, va = grad_ellipses[i, 0], grad_ellipses[i, 1], grad_ellipses[i, 2]
        vb, vc = grad_ellipses[i, 3], grad_ellipses[i, 4]
        grad_opacities[i] = grad_ellipses[i, 5]

        # d(C^-1) = -C^-1 dC C^-1: gradient of the covariance, as a symmetric matrix (hxx, hxy, hyy).
        a, b, c = ellipses[i, CONIC_XX], ellipses[i, CONIC_XY], ellipses[i, CONIC_YY]
        vb *= 0.5
        hxx = -(a * a * va + 2 * a * b * vb + b * b * vc)
        hxy = -(a * b * va + (a * c + b * b) * vb + b * c * vc)
        hyy = -(b * b * va + 2 * b * c * vb + c * c * vc)

        x, y, z = _inside(means, i, camera)
        plane = _plane(x, y, z, camera)
        w, qx, qy, qz, norm = _unit(quaternions, i)
        rotation = _rotation(w, qx, qy, qz)

        # Covariance = sum_k s_k^2 a_k a_k^T + blur with a_k = plane r_k: gradients of the scales, of `plane` and of r_k.
        p00, p01, p02, p10, p11, p12 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        g = np.empty(9)
        for k in range(3):
            ax, ay = _axis(plane, rotation, k)
            scale = np.float64(scales[i, k])
            hx, hy = hxx * ax + hxy * ay, hxy * ax + hyy * ay
            grad_scales[i, k] = 2 * scale * (ax * hx + ay * hy)
            hx *= 2 * scale * scale
            hy *= 2 * scale * scale
            p00 += hx * rotation[k]
            p01 += hx * rotation[3 + k]
            p02 += hx * rotation[6 + k]
            p10 += hy * rotation[k]
            p11 += hy * rotation[3 + k]
            p12 += hy * rotation[6 + k]
            for row in range(3):
                g[3 * row + k] = plane[row] * hx + plane[3 + row] * hy

        vw = 2 * (qx * (g[7] - g[5]) + qy * (g[2] - g[6]) + qz * (g[3] - g[1]))
        vx = 2 * (w * (g[7] - g[5]) + qy * (g[1] + g[3]) + qz * (g[2] + g[6]) - 2 * qx * (g[4] + g[8]))
        vy = 2 * (w * (g[2] - g[6]) + qx * (g[1] + g[3]) + qz * (g[5] + g[7]) - 2 * qy * (g[0] + g[8]))
        vz = 2 * (w * (g[3] - g[1]) + qx * (g[2] + g[6]) + qy * (g[5] + g[7]) - 2 * qz * (g[0] + g[4]))
        along = vw * w + vx * qx + vy * qy + vz * qz
        grad_quaternions[i, 0] = (vw - along * w) / norm
        grad_quaternions[i, 1] = (vx - along * qx) / norm
        grad_quaternions[i, 2] = (vy - along * qy) / norm
        grad_quaternions[i, 3] = (vz - along * qz) / norm

        # plane = J axes; J = (fx/z, 0, -fx sx/z; 0, fy/z, -fy sy/z) with the clamped slopes sx, sy.
        fx, fy = camera[12], camera[13]
        sx, sy = _slopes(x, y, z, camera)
        j00 = p00 * camera[0] + p01 * camera[1] + p02 * camera[2]
        j02 = p00 * camera[6] + p01 * camera[7] + p02 * camera[8]
        j11 = p10 * camera[3] + p11 * camera[4] + p12 * camera[5]
        j12 = p10 * camera[6] + p11 * camera[7] + p12 * camera[8]
        vx = vu * fx / z
        vy = vv * fy / z
        vz = -(vu * fx * x + vv * fy * y + j00 * fx - j02 * fx * sx + j11 * fy - j12 * fy * sy) / (z * z)
        if camera[16] <= x / z <= camera[17]:
            vx -= j02 * fx / (z * z)
            vz += j02 * fx * x / (z * z * z)
        if camera[18] <= y / z <= camera[19]:
            vy -= j12 * fy / (z * z)
            vz += j12 * fy * y / (z * z * z)
        for k in range(3):
            grad_means[i, k] = vx * camera[k] + vy * camera[3 + k] + vz * camera[6 + k]


@njit(error_model="numpy")
def _inside(means, i, camera):
    """Position in the camera's frame."""
    x = np.float64(means[i, 0]) - camera[9]
    y = np.float64(means[i, 1]) - camera[10]
    z = np.float64(means[i, 2]) - camera[11]
    return (
        camera[0] * x + camera[1] * y + camera[2] * z,
        camera[3] * x + camera[4] * y + camera[5] * z,
        camera[6] * x + camera[7] * y + camera[8] * z,
    )


@njit(error_model="numpy")
def _slopes(x, y, z, camera):
    """x/z and y/z, clamped as the Jacobian sees them."""
    return min(max(x / z, camera[16]), camera[17]), min(max(y / z, camera[18]), camera[19])


@njit(error_model="numpy")
def _plane(x, y, z, camera):
    """The 2x3 matrix J R from the world to the image plane, row by row."""
    sx, sy = _slopes(x, y, z, camera)
    fx, fy = camera[12] / z, camera[13] / z
    return (
        fx * (camera[0] - sx * camera[6]),
        fx * (camera[1] - sx * camera[7]),
        fx * (camera[2] - sx * camera[8]),
        fy * (camera[3] - sy * camera[6]),
        fy * (camera[4] - sy * camera[7]),
        fy * (camera[5] - sy * camera[8]),
    )


@njit(error_model="numpy")
def _axis(plane, rotation, k):
    """Axis k of a Gaussian (a unit vector in the world) projected to the image plane."""
    x, y, z = rotation[k], rotation[3 + k], rotation[6 + k]
    return plane[0] * x + plane[1] * y + plane[2] * z, plane[3] * x + plane[4] * y + plane[5] * z


@njit(error_model="numpy")
def _unit(quaternions, i):
    """Unit quaternion (w, x, y, z), and the length by which it was divided."""
    w, x = np.float64(quaternions[i, 0]), np.float64(quaternions[i, 1])
    y, z = np.float64(quaternions[i, 2]), np.float64(quaternions[i, 3])
    norm = max(math.sqrt(w * w + x * x + y * y + z * z), SMALLEST_NORM)
    return w / norm, x / norm, y / norm, z / norm, norm


@njit(error_model="numpy")
def _rotation(w, x, y, z):
    """Rotation matrix of a unit quaternion, row by row."""
    return (
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    )  # fmt: skip
