"""Numba kernels: ellipses into tiles, tiles into pixels, and back. Parallel over tiles; the same bits in every run.

A pair is one Gaussian in one tile; all memory is linear in their number. Pairs are numbered twice: in a tile's list, front
to back, where the picture is drawn, and Gaussian by Gaussian, where gradients are summed without a race.
Alpha and transmittance are float64 in every dtype (see `projection_kernels`), sums of features are in the features' own.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, prange

from semgs.rendering.projection_kernels import (
    CENTRE_X,
    CENTRE_Y,
    CONIC_XX,
    CONIC_XY,
    CONIC_YY,
    DETERMINANT,
    OPACITY,
    REACH,
)
from semgs.rendering.rules import MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE

TILE = 16
"""Side of a tile [px]."""

PARTS = 16
"""Parts that the depth order is cut into for counting, a number of its own so that the result is the same on any machine."""

STRIDE = 16
"""Tiles are visited this many apart, so that every thread's share is spread over the picture."""


@njit(cache=True, parallel=True)
def count_pairs(ellipses, order, height, width, rectangles, per_gaussian, counts):
    """Find the tiles of every ellipse that is drawn and count the pairs.

    Args:
        rectangles: [g 4], filled with the first and end row and column of tiles.
        per_gaussian: [g], zeros, filled with the number of pairs.
        counts: [PARTS tiles], zeros, filled with each part's number of pairs in each tile.
    """
    tiles_x = (width + TILE - 1) // TILE
    for i in prange(len(ellipses)):
        top, bottom, left, right = _rectangle(ellipses, i, height, width)
        rectangles[i, 0], rectangles[i, 1], rectangles[i, 2], rectangles[i, 3] = top, bottom, left, right
    for part in prange(PARTS):
        for rank in range(part * len(order) // PARTS, (part + 1) * len(order) // PARTS):
            i = order[rank]
            pairs = 0
            for row in range(rectangles[i, 0], rectangles[i, 1]):
                left, right = _tile_columns(ellipses, i, rectangles, row, width)
                for column in range(left, right):
                    counts[part, row * tiles_x + column] += 1
                pairs += right - left
            per_gaussian[i] = pairs


@njit(cache=True, parallel=True)
def fill_pairs(ellipses, order, width, rectangles, first_pair, starts, gaussians, pairs):
    """Fill each tile's list, front to back: the Gaussians [pairs] and their pairs' numbers Gaussian by Gaussian [pairs].

    `starts` [PARTS tiles] is where each part begins in each tile's list; it is used up.
    """
    tiles_x = (width + TILE - 1) // TILE
    for part in prange(PARTS):
        for rank in range(part * len(order) // PARTS, (part + 1) * len(order) // PARTS):
            i = order[rank]
            pair = first_pair[i]
            for row in range(rectangles[i, 0], rectangles[i, 1]):
                left, right = _tile_columns(ellipses, i, rectangles, row, width)
                for column in range(left, right):
                    tile = row * tiles_x + column
                    at = starts[part, tile]
                    starts[part, tile] = at + 1
                    gaussians[at] = i
                    pairs[at] = pair
                    pair += 1


@njit(cache=True, parallel=True)
def draw(ellipses, features, first_in_tile, gaussians, picture, transmittance, last):
    """Fill picture [c h w], transmittance [h w] and, per pixel, the place in its tile's list of the last one added (or -1)."""
    count = len(first_in_tile) - 1
    rounds = (count + STRIDE - 1) // STRIDE
    for visit in prange(rounds * STRIDE):
        tile = (visit % rounds) * STRIDE + visit // rounds
        if tile < count:
            _draw_tile(
                ellipses, features, gaussians[first_in_tile[tile] : first_in_tile[tile + 1]], tile,
                picture, transmittance, last,
            )  # fmt: skip


@njit(cache=True, parallel=True)
def draw_backward(
    ellipses, features, first_in_tile, gaussians, pairs, transmittance, last, grad_picture, grad_transmittance,
    pair_geometry, pair_features,
):  # fmt: skip
    """Fill the gradients of every pair, both zeros: geometry [pairs 6] as `project_backward` takes it, features [pairs c]."""
    count = len(first_in_tile) - 1
    rounds = (count + STRIDE - 1) // STRIDE
    for visit in prange(rounds * STRIDE):
        tile = (visit % rounds) * STRIDE + visit // rounds
        if tile < count:
            begin, end = first_in_tile[tile], first_in_tile[tile + 1]
            _draw_tile_backward(
                ellipses, features, gaussians[begin:end], pairs[begin:end], tile, transmittance, last,
                grad_picture, grad_transmittance, pair_geometry, pair_features,
            )  # fmt: skip


@njit(cache=True)
def _draw_tile(ellipses, features, gaussians, tile, picture, transmittance, last):
    channels, height, width = picture.shape
    tiles_x = (width + TILE - 1) // TILE
    top, left = tile // tiles_x * TILE, tile % tiles_x * TILE
    bottom, right = min(top + TILE, height), min(left + TILE, width)
    blended = np.zeros((TILE * TILE, channels), features.dtype)
    light = np.ones(TILE * TILE)
    finished = np.zeros(TILE * TILE, np.bool_)
    latest = np.full(TILE * TILE, -1, np.int32)
    unfinished = (bottom - top) * (right - left)
    for place in range(len(gaussians)):
        if unfinished == 0:
            break
        i = gaussians[place]
        opacity = ellipses[i, OPACITY]
        x, y = ellipses[i, CENTRE_X], ellipses[i, CENTRE_Y]
        xx, xy, yy = ellipses[i, CONIC_XX], ellipses[i, CONIC_XY], ellipses[i, CONIC_YY]
        reach_xx, determinant, narrow = ellipses[i, REACH] * xx, ellipses[i, DETERMINANT], 1 / xx
        first_row, end_row = _rows(ellipses, i, top, bottom)
        for row in range(first_row, end_row):
            dy = row + 0.5 - y
            half = math.sqrt(max(0.0, reach_xx - determinant * dy * dy)) * narrow
            middle = x - xy * narrow * dy
            first, end = _pixels(middle - half, middle + half, left, right)
            for column in range(first, end):
                pixel = (row - top) * TILE + column - left
                if finished[pixel]:
                    continue
                dx = column + 0.5 - x
                sigma = 0.5 * (xx * dx * dx + yy * dy * dy) + xy * dx * dy
                alpha = min(MAX_ALPHA, opacity * math.exp(-sigma))
                if sigma < 0 or alpha < MIN_ALPHA:
                    continue
                after = light[pixel] * (1 - alpha)
                if after <= MIN_TRANSMITTANCE:
                    finished[pixel] = True
                    unfinished -= 1
                    continue
                _add(blended, pixel, features, i, alpha * light[pixel])
                light[pixel] = after
                latest[pixel] = place
    for row in range(top, bottom):
        for column in range(left, right):
            pixel = (row - top) * TILE + column - left
            transmittance[row, column] = light[pixel]
            last[row, column] = latest[pixel]
    for channel in range(channels):
        for row in range(top, bottom):
            for column in range(left, right):
                picture[channel, row, column] = blended[(row - top) * TILE + column - left, channel]


@njit(cache=True)
def _draw_tile_backward(
    ellipses, features, gaussians, pairs, tile, transmittance, last, grad_picture, grad_transmittance,
    pair_geometry, pair_features,
):  # fmt: skip
    channels, height, width = grad_picture.shape
    tiles_x = (width + TILE - 1) // TILE
    top, left = tile // tiles_x * TILE, tile % tiles_x * TILE
    bottom, right = min(top + TILE, height), min(left + TILE, width)
    grad = np.zeros((TILE * TILE, channels), features.dtype)
    for channel in range(channels):
        for row in range(top, bottom):
            for column in range(left, right):
                grad[(row - top) * TILE + column - left, channel] = grad_picture[channel, row, column]
    light = np.ones(TILE * TILE)
    behind = np.zeros(
        TILE * TILE
    )  # sum of w_j (f_j . gradient) and of the gradient of T times T, over what lies behind
    latest = np.full(TILE * TILE, -1, np.int32)
    final = -1
    for row in range(top, bottom):
        for column in range(left, right):
            pixel = (row - top) * TILE + column - left
            light[pixel] = transmittance[row, column]
            behind[pixel] = grad_transmittance[row, column] * light[pixel]
            latest[pixel] = last[row, column]
            final = max(final, latest[pixel])

    for place in range(final, -1, -1):
        i = gaussians[place]
        pair = pairs[place]
        opacity = ellipses[i, OPACITY]
        xx, xy, yy = ellipses[i, CONIC_XX], ellipses[i, CONIC_XY], ellipses[i, CONIC_YY]
        vx, vy, vxx, vxy, vyy, vo = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        x, y = ellipses[i, CENTRE_X], ellipses[i, CENTRE_Y]
        reach_xx, determinant, narrow = ellipses[i, REACH] * xx, ellipses[i, DETERMINANT], 1 / xx
        first_row, end_row = _rows(ellipses, i, top, bottom)
        for row in range(first_row, end_row):
            dy = row + 0.5 - y
            half = math.sqrt(max(0.0, reach_xx - determinant * dy * dy)) * narrow
            middle = x - xy * narrow * dy
            first, end = _pixels(middle - half, middle + half, left, right)
            for column in range(first, end):
                pixel = (row - top) * TILE + column - left
                if place > latest[pixel]:
                    continue
                dx = column + 0.5 - x
                sigma = 0.5 * (xx * dx * dx + yy * dy * dy) + xy * dx * dy
                falloff = math.exp(-sigma)
                alpha = min(MAX_ALPHA, opacity * falloff)
                if sigma < 0 or alpha < MIN_ALPHA:
                    continue
                light[pixel] /= 1 - alpha
                weight = alpha * light[pixel]
                _add(pair_features, pair, grad, pixel, weight)
                shade = _dot(features, i, grad, pixel)
                v_alpha = light[pixel] * shade - behind[pixel] / (1 - alpha)
                behind[pixel] += weight * shade
                if opacity * falloff <= MAX_ALPHA:
                    vo += v_alpha * falloff
                    v_sigma = -v_alpha * alpha
                    vx -= v_sigma * (xx * dx + xy * dy)
                    vy -= v_sigma * (xy * dx + yy * dy)
                    vxx += v_sigma * 0.5 * dx * dx
                    vxy += v_sigma * dx * dy
                    vyy += v_sigma * 0.5 * dy * dy
        pair_geometry[pair, 0] = vx
        pair_geometry[pair, 1] = vy
        pair_geometry[pair, 2] = vxx
        pair_geometry[pair, 3] = vxy
        pair_geometry[pair, 4] = vyy
        pair_geometry[pair, 5] = vo


@njit(cache=True)
def _add(sums, i, rows, j, weight):
    """sums[i] += weight rows[j]."""
    factor = sums.dtype.type(weight)
    for channel in range(sums.shape[1]):
        sums[i, channel] += factor * rows[j, channel]


@njit(cache=True, fastmath={"reassoc", "contract"})
def _dot(a, i, b, j):
    """a[i] . b[j]; the order of summation is the compiler's, and the same in every run."""
    total = a.dtype.type(0)
    for channel in range(a.shape[1]):
        total += a[i, channel] * b[j, channel]
    return total


@njit(cache=True)
def _pixels(low, high, first, end):
    """Pixels in first..end - 1 whose centre is in low..high, as begin and end; the slack of the reach covers rounding."""
    low, high = max(low, first), min(high, end)
    return max(first, math.ceil(low - 0.5)), min(end, math.floor(high + 0.5))


@njit(cache=True)
def _rows(ellipses, i, top, bottom):
    """Rows of pixels in top..bottom - 1 that an ellipse meets, as begin and end."""
    half = math.sqrt(ellipses[i, REACH] * ellipses[i, CONIC_XX] / ellipses[i, DETERMINANT])
    return _pixels(ellipses[i, CENTRE_Y] - half, ellipses[i, CENTRE_Y] + half, top, bottom)


@njit(cache=True)
def _rectangle(ellipses, i, height, width):
    """First and end row and column of the tiles that an ellipse's bounding box meets."""
    if ellipses[i, REACH] < 0:
        return 0, 0, 0, 0
    half = math.sqrt(ellipses[i, REACH] * ellipses[i, CONIC_YY] / ellipses[i, DETERMINANT])
    top, bottom = _rows(ellipses, i, 0, height)
    left, right = _pixels(ellipses[i, CENTRE_X] - half, ellipses[i, CENTRE_X] + half, 0, width)
    if top >= bottom or left >= right:
        return 0, 0, 0, 0
    return top // TILE, (bottom - 1) // TILE + 1, left // TILE, (right - 1) // TILE + 1


@njit(cache=True)
def _tile_columns(ellipses, i, rectangles, tile_row, width):
    """Tiles of one row that an ellipse meets, as begin and end: exact, since both ellipse and row are convex.

    Its right edge is furthest right at dy = -(xy / yy) times its half width, its left edge opposite; where that lies outside
    the band of the row's pixel centres, at the band's nearest border.
    """
    top, bottom, first, end = rectangles[i]
    if bottom - top == 1 or end - first == 1:
        return first, end
    xx, xy, yy = ellipses[i, CONIC_XX], ellipses[i, CONIC_XY], ellipses[i, CONIC_YY]
    reach, determinant = ellipses[i, REACH], ellipses[i, DETERMINANT]
    low = tile_row * TILE + 0.5 - ellipses[i, CENTRE_Y]
    high = low + TILE - 1
    turn = -xy / yy * math.sqrt(reach * yy / determinant)
    at_right = min(max(turn, low), high)
    at_left = min(max(-turn, low), high)
    right = (math.sqrt(max(0.0, reach * xx - determinant * at_right * at_right)) - xy * at_right) / xx
    left = -(math.sqrt(max(0.0, reach * xx - determinant * at_left * at_left)) + xy * at_left) / xx
    begin, stop = _pixels(ellipses[i, CENTRE_X] + left, ellipses[i, CENTRE_X] + right, 0, width)
    if begin >= stop:
        return first, first
    return begin // TILE, (stop - 1) // TILE + 1
