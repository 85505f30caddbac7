"""Kernels for indirect light: rays to nearby surfaces, the light they return, and smoothing that stops at edges.

Each pixel casts a few rays. The pixels of a square of `TILE` x `TILE` cast theirs in different directions (interleaved
sampling), so the mean over the pixels of the square that show one surface is the mean over all these directions.
"""

from __future__ import annotations

import math

from semgs.runtime.jit import njit

TILE = 4
TAPS = 4
"""Rays per pixel for indirect light."""
REACH = 1.3
"""Length of these rays [m]. Rays that hit nothing return the room's mean light."""
FLAT = 0.015
"""Points closer to a pixel's plane than this share of its depth are on the same surface."""
ALIKE = 0.9
"""Minimum cosine between normals of the same surface."""


@njit()
def stratum(pixel, width, tap, taps):
    """Two numbers in 0..1 for a ray of a pixel, from a low-discrepancy sequence (R2) over its square."""
    row, column = pixel // width, pixel % width
    place = ((row % TILE) * TILE + (column % TILE) * 7) % (TILE * TILE) * taps + tap
    return (0.5 + 0.7548776662466927 * place) % 1.0, (0.5 + 0.5698402909980532 * place) % 1.0


@njit()
def near_rays(triangles, directions, places, planes, width, tap, origins, ways):
    """Cosine-distributed rays around the normal of the triangle that was hit, each `REACH` long."""
    for r in range(len(triangles)):
        if triangles[r] < 0:
            for k in range(3):
                origins[r, k], ways[r, k] = 0.0, 1.0
            continue
        plane = planes[triangles[r]]
        sign = (
            1.0 if plane[0] * directions[r, 0] + plane[1] * directions[r, 1] + plane[2] * directions[r, 2] < 0 else -1.0
        )
        nx, ny, nz = sign * plane[0], sign * plane[1], sign * plane[2]
        first, second = stratum(r, width, tap, TAPS)
        turn, out = 2 * math.pi * first, math.sqrt(second)
        a, b, c = out * math.cos(turn), out * math.sin(turn), math.sqrt(1 - second)
        side = 1.0 if nz >= 0 else -1.0
        p = -1 / (side + nz)
        q = nx * ny * p
        ways[r, 0] = REACH * (a * (1 + side * nx * nx * p) + b * q + c * nx)
        ways[r, 1] = REACH * (a * side * q + b * (side + ny * ny * p) + c * ny)
        ways[r, 2] = REACH * (-a * side * nx - b * ny + c * nz)
        origins[r, 0], origins[r, 1], origins[r, 2] = (
            places[r, 0] + 0.003 * nx,
            places[r, 1] + 0.003 * ny,
            places[r, 2] + 0.003 * nz,
        )


@njit()
def bring_back(hits, distances, owners, glow, ambient, out):
    """Add the light that rays return to `out` [r 3]: the room's mean light if they hit nothing, else mixed with the glow of the
    part they hit, the more of it the closer it is."""
    for r in range(len(hits)):
        share = 1.0 if hits[r] < 0 else distances[r] * distances[r]
        for k in range(3):
            near = glow[owners[hits[r]], k] if hits[r] >= 0 else 0.0
            out[r, k] += (share * ambient[k] + (1 - share) * near) / TAPS


@njit()
def smooth(values, triangles, normals, places, depths, width, out):
    """Mean over each pixel's square, of pixels on the same surface only; `values` and `out` are [r c], rows have `width` pixels."""
    height = len(triangles) // width
    channels = values.shape[1]
    for r in range(len(triangles)):
        if triangles[r] < 0:
            for k in range(channels):
                out[r, k] = values[r, k]
            continue
        row, column = r // width, r % width
        nx, ny, nz = normals[r, 0], normals[r, 1], normals[r, 2]
        limit, count = FLAT * depths[r], 0
        for k in range(channels):
            out[r, k] = 0.0
        for i in range(max(0, row - 1), min(height, row + TILE - 1)):
            for j in range(max(0, column - 1), min(width, column + TILE - 1)):
                s = i * width + j
                if triangles[s] < 0 or nx * normals[s, 0] + ny * normals[s, 1] + nz * normals[s, 2] < ALIKE:
                    continue
                off = (
                    nx * (places[s, 0] - places[r, 0])
                    + ny * (places[s, 1] - places[r, 1])
                    + nz * (places[s, 2] - places[r, 2])
                )
                if abs(off) > limit:
                    continue
                count += 1
                for k in range(channels):
                    out[r, k] += values[s, k]
        for k in range(channels):
            out[r, k] /= count


@njit()
def borrow(pixels, parts, owners, width, values, out):
    """For each ray, the values [p c] of the nearest neighbouring pixel that shows the part it hit, else of the ray's own pixel.

    `pixels` and `parts` [r] are the pixel of each ray and the part it hit; `owners` is the part that each pixel shows.
    """
    height = len(owners) // width
    for r in range(len(pixels)):
        best, source = 99, pixels[r]
        row, column = pixels[r] // width, pixels[r] % width
        for i in range(max(0, row - 1), min(height, row + 2)):
            for j in range(max(0, column - 1), min(width, column + 2)):
                far = abs(i - row) + abs(j - column)
                if owners[i * width + j] == parts[r] and far < best:
                    best, source = far, i * width + j
        for k in range(values.shape[1]):
            out[r, k] = values[source, k]
