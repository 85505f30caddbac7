"""Numba kernels: from ellipses to tiles, from tiles to pixels, and backwards. Each call does one part of the work (`in_threads`).

Results are exactly the same in every run.

A pair is one Gaussian in one tile. Memory is linear in the number of pairs, so if there are many, the caller renders one run of tiles
after the other (tiles are numbered row by row). Pairs have two numbers: in the list of their tile, front to back, for rendering; and
Gaussian by Gaussian, so that gradients are summed without a race.
Alpha and transmittance are float64 in every dtype (see `projection_kernels`), sums of features are in the features' own.

The inner loops run over all pixels of the rows of a tile that an ellipse touches, without a branch and between two unsigned numbers:
LLVM only vectorises them in this form. They do more arithmetic than a loop over just the pixels inside, in a third of the time. They
take complete arrays, because a slice costs more than a short loop.
"""

from __future__ import annotations

import math

import numpy as np

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
from semgs.runtime.jit import njit

TILE_HEIGHT, TILE_WIDTH = 16, 8
"""Sides of a tile [px]. A row is one or two vectors long, and most ellipses of a feed-forward scene are not much wider."""

PIXELS = TILE_HEIGHT * TILE_WIDTH

FARTHEST = 8.0
"""Largest exponent that matters: exp(-8) < 1/255, so beyond it no opacity up to 1 is visible."""

HALVINGS = 4
"""exp(-s) is (a polynomial in s / 2^4), squared 4 times."""

MIDDLE = FARTHEST / 2 ** (HALVINGS + 1)

COEFFICIENTS = tuple(math.exp(-MIDDLE) * (-1) ** k / math.factorial(k) for k in range(12))
"""Of exp(-s) about s = MIDDLE, constant term first; the next term is below the rounding at both ends."""

BLOCK = 64
"""Gaussians of a tile that are copied together before rendering: they are scattered in memory, and fetching them one by one would be
slow. After each block, a check whether the tile is finished."""

SHARES = 16
"""Shares of the Gaussians for counting, so that threads do not wait for each other."""

DIGIT = 9
"""Bits of a rank that are sorted at a time: two digits for a quarter of a million Gaussians."""


@njit(error_model="numpy", nogil=True)
def count_pairs(ellipses, ranks, first, height, width, rectangles, per_gaussian, counts, part, parts):
    """Find the tiles of every ellipse and count the pairs of a run of tiles.

    Args:
        ranks: [g], place in the depth order, negative if not rendered.
        first: tile of the run.
        rectangles: [g 4], filled with the first and end row and column of tiles of the image.
        per_gaussian: [g], filled with the number of pairs.
        counts: [SHARES tiles], zeros, filled with each share's number of pairs in each tile of the run.
    """
    end = first + counts.shape[1]
    for share in range(part, SHARES, parts):
        for i in range(share * len(ranks) // SHARES, (share + 1) * len(ranks) // SHARES):
            pairs = 0
            if ranks[i] >= 0:
                _fill_rectangle(ellipses, i, height, width, rectangles)
                top, bottom = _tile_rows(rectangles, i, width, first, end)
                for row in range(top, bottom):
                    begin, stop = _tiles(ellipses, i, rectangles, row, width, first, end)
                    for tile in range(begin, stop):
                        counts[share, tile - first] += 1
                        pairs += 1
            per_gaussian[i] = pairs


@njit(error_model="numpy", nogil=True)
def fill_pairs(ellipses, ranks, first, width, rectangles, first_pair, starts, keys, part, parts):
    """Fill each tile's list of keys [pairs]: rank in the high half, number of the pair Gaussian by Gaussian in the low one.

    `first` is the run's first tile; `starts` [SHARES tiles], where each share begins in each tile's list, is used up.
    """
    end = first + starts.shape[1]
    for share in range(part, SHARES, parts):
        for i in range(share * len(ranks) // SHARES, (share + 1) * len(ranks) // SHARES):
            pair = first_pair[i]
            if pair == first_pair[i + 1]:
                continue
            top, bottom = _tile_rows(rectangles, i, width, first, end)
            for row in range(top, bottom):
                begin, stop = _tiles(ellipses, i, rectangles, row, width, first, end)
                for tile in range(begin, stop):
                    keys[starts[share, tile - first]] = np.int64(ranks[i]) << 32 | pair
                    starts[share, tile - first] += 1
                    pair += 1


@njit(error_model="numpy", nogil=True)
def sort_pairs(first_in_tile, order, keys, gaussians, part, parts):
    """Sort each tile's list front to back: fill the Gaussians [pairs] and leave the pairs' numbers in `keys` [pairs]."""
    digits = 1
    while len(order) >> (DIGIT * digits):
        digits += 1
    for tile in range(part, len(first_in_tile) - 1, parts):
        begin, end = first_in_tile[tile], first_in_tile[tile + 1]
        ranked = _by_rank(keys[begin:end], digits)
        for at in range(end - begin):
            gaussians[begin + at] = order[ranked[at] >> 32]
            keys[begin + at] = ranked[at] & 0xFFFFFFFF


@njit(error_model="numpy")
def _by_rank(keys, digits):
    """The keys in ascending order of their high half, by counting one digit after the other (radix sort)."""
    source, sorted_keys = keys.copy(), np.empty_like(keys)
    ends = np.empty(1 << DIGIT, np.int64)
    for digit in range(digits):
        shift = 32 + DIGIT * digit
        ends[:] = 0
        for key in source:
            ends[(key >> shift) & ((1 << DIGIT) - 1)] += 1
        total = 0
        for value in range(1 << DIGIT):
            total += ends[value]
            ends[value] = total - ends[value]
        for key in source:
            value = (key >> shift) & ((1 << DIGIT) - 1)
            sorted_keys[ends[value]] = key
            ends[value] += 1
        source, sorted_keys = sorted_keys, source
    return source


@njit(error_model="numpy", nogil=True)
def draw(ellipses, features, first, first_in_tile, gaussians, picture, transmittance, last, part, parts):
    """Render the pixels of a run of tiles that begins with tile `first`.

    Picture [c h w], transmittance [h w] and, per pixel, the place in its tile's list of the last one added (or -1).
    """
    for tile in range(part, len(first_in_tile) - 1, parts):
        _draw_tile(
            ellipses, features, gaussians[first_in_tile[tile] : first_in_tile[tile + 1]], first + tile,
            picture, transmittance, last,
        )  # fmt: skip


@njit(error_model="numpy", nogil=True)
def draw_backward(
    ellipses, features, first, first_in_tile, gaussians, pairs, transmittance, last, grad_picture, grad_transmittance,
    pair_geometry, pair_features, part, parts,
):  # fmt: skip
    """Fill the gradients of every pair of a run of tiles, both zeros: geometry [pairs 6] as `add_pairs` takes it, features [pairs c]."""
    for tile in range(part, len(first_in_tile) - 1, parts):
        begin, end = first_in_tile[tile], first_in_tile[tile + 1]
        _draw_tile_backward(
            ellipses, features, gaussians[begin:end], pairs[begin:end], first + tile, transmittance, last,
            grad_picture, grad_transmittance, pair_geometry, pair_features,
        )  # fmt: skip


@njit(error_model="numpy", nogil=True)
def add_pairs(first_pair, pair_geometry, pair_features, grad_ellipses, grad_features, part, parts):
    """Add each Gaussian's gradients over a run of tiles, in an order that does not depend on how tiles are split into runs.

    Args:
        first_pair: [g + 1], the pairs of Gaussian i are first_pair[i] .. first_pair[i + 1] - 1.
        pair_geometry: [pairs 6], gradients of centre, inverse covariance (xy counted once) and opacity.
        pair_features: [pairs c].
        grad_ellipses: [g 6], added to.
        grad_features: [g c], added to.
    """
    count = len(first_pair) - 1
    for i in range(part * count // parts, (part + 1) * count // parts):
        for pair in range(first_pair[i], first_pair[i + 1]):
            for k in range(6):
                grad_ellipses[i, k] += pair_geometry[pair, k]
            for channel in range(pair_features.shape[1]):
                grad_features[i, channel] += pair_features[pair, channel]


@njit(error_model="numpy")
def _draw_tile(ellipses, features, gaussians, tile, picture, transmittance, last):
    channels, height, width = picture.shape
    top, bottom, left, right = _sides(tile, height, width)
    xs, ys = _centres(top, left)
    light = np.full(PIXELS, -1.0)  # negative where a pixel is finished, or outside the image
    latest = np.full(PIXELS, -1.0)
    for row in range(bottom - top):
        light[row * TILE_WIDTH : row * TILE_WIDTH + right - left] = 1.0
    weights = np.empty(PIXELS, features.dtype)
    blended = np.zeros((channels, PIXELS), features.dtype)
    near_ellipses, near_features = _block(ellipses, features)
    for begin in range(0, len(gaussians), BLOCK):
        if _finished(light):
            break
        count = min(BLOCK, len(gaussians) - begin)
        _fetch(ellipses, features, gaussians[begin : begin + count], near_ellipses, near_features)
        for j in range(count):
            first, end = _span(near_ellipses, j, top, bottom)
            if first >= end:
                continue
            _weigh(near_ellipses, j, xs, ys, float(begin + j), light, latest, weights, first, end)
            _blend(blended, near_features, j, weights, first, end)
    for row in range(top, bottom):
        begin = (row - top) * TILE_WIDTH
        for column in range(left, right):
            pixel = begin + column - left
            transmittance[row, column] = abs(light[pixel])
            last[row, column] = np.int32(latest[pixel])
        for channel in range(channels):
            for column in range(left, right):
                picture[channel, row, column] = blended[channel, begin + column - left]


@njit(error_model="numpy", fastmath={"contract"})
def _weigh(ellipses, j, xs, ys, place, light, latest, weights, first, end):
    """Render one Gaussian: fill its weights alpha T, and update the remaining light and the last place."""
    x, y, opacity = ellipses[j, CENTRE_X], ellipses[j, CENTRE_Y], ellipses[j, OPACITY]
    xx, xy, yy = 0.5 * ellipses[j, CONIC_XX], ellipses[j, CONIC_XY], 0.5 * ellipses[j, CONIC_YY]
    for k in range(first, end):
        dx, dy = xs[k] - x, ys[k] - y
        sigma = xx * dx * dx + yy * dy * dy + xy * dx * dy
        alpha = opacity * _exponential(sigma)
        alpha = alpha if alpha < MAX_ALPHA else MAX_ALPHA
        before = light[k]
        weight = alpha * before
        after = before - weight
        seen = (sigma >= 0) & (alpha >= MIN_ALPHA) & (before > 0)
        added = seen & (after > MIN_TRANSMITTANCE)
        after = after if after > MIN_TRANSMITTANCE else -before
        light[k] = after if seen else before
        latest[k] = place if added else latest[k]
        weights[k] = weight if added else 0.0


@njit(error_model="numpy", fastmath={"contract"})
def _blend(blended, features, j, weights, first, end):
    """Add features times weights to the pixels."""
    for channel in range(blended.shape[0]):
        factor = features[j, channel]
        for k in range(first, end):
            blended[channel, k] += factor * weights[k]


@njit(error_model="numpy")
def _draw_tile_backward(
    ellipses, features, gaussians, pairs, tile, transmittance, last, grad_picture, grad_transmittance,
    pair_geometry, pair_features,
):  # fmt: skip
    channels, height, width = grad_picture.shape
    top, bottom, left, right = _sides(tile, height, width)
    xs, ys = _centres(top, left)
    grad = np.zeros((channels, PIXELS), features.dtype)
    light = np.ones(PIXELS)
    # Sum of w_j (f_j . gradient) and of the gradient of T times T, over what is behind.
    behind = np.zeros(PIXELS)
    latest = np.full(PIXELS, -1.0)
    for row in range(top, bottom):
        for column in range(left, right):
            pixel = (row - top) * TILE_WIDTH + column - left
            light[pixel] = transmittance[row, column]
            behind[pixel] = grad_transmittance[row, column] * light[pixel]
            latest[pixel] = last[row, column]
            for channel in range(channels):
                grad[channel, pixel] = grad_picture[channel, row, column]
    alphas, falloffs = np.empty(PIXELS), np.empty(PIXELS)
    weights, shades = np.empty(PIXELS, features.dtype), np.empty(PIXELS, features.dtype)
    near_ellipses, near_features = _block(ellipses, features)
    final = int(latest.max())
    for begin in range(final // BLOCK * BLOCK, -1, -BLOCK):
        count = min(BLOCK, final + 1 - begin)
        _fetch(ellipses, features, gaussians[begin : begin + count], near_ellipses, near_features)
        for j in range(count - 1, -1, -1):
            first, end = _span(near_ellipses, j, top, bottom)
            if first < end and _alphas(
                near_ellipses, j, xs, ys, float(begin + j), latest, alphas, falloffs, first, end
            ):
                pair = pairs[begin + j]
                _shade(near_features, j, grad, shades, first, end)
                geometry = _unweigh(
                    near_ellipses, j, xs, ys, alphas, falloffs, shades, light, behind, weights, first, end
                )
                for k in range(6):
                    pair_geometry[pair, k] = geometry[k]
                _gather(grad, weights, pair_features, pair, first, end)


@njit(error_model="numpy", fastmath={"contract"})
def _alphas(ellipses, j, xs, ys, place, latest, alphas, falloffs, first, end):
    """Fill alpha (0 where the Gaussian was not added) and falloff; returns the number of pixels where it was added."""
    x, y, opacity = ellipses[j, CENTRE_X], ellipses[j, CENTRE_Y], ellipses[j, OPACITY]
    xx, xy, yy = 0.5 * ellipses[j, CONIC_XX], ellipses[j, CONIC_XY], 0.5 * ellipses[j, CONIC_YY]
    count = 0
    for k in range(first, end):
        dx, dy = xs[k] - x, ys[k] - y
        sigma = xx * dx * dx + yy * dy * dy + xy * dx * dy
        falloff = _exponential(sigma)
        alpha = opacity * falloff
        alpha = alpha if alpha < MAX_ALPHA else MAX_ALPHA
        added = (sigma >= 0) & (alpha >= MIN_ALPHA) & (place <= latest[k])
        alphas[k] = alpha if added else 0.0
        falloffs[k] = falloff
        count += added
    return count


@njit(error_model="numpy", fastmath={"contract"})
def _shade(features, j, grad, shades, first, end):
    """Fill features . gradient of each pixel."""
    for k in range(first, end):
        shades[k] = 0
    for channel in range(len(grad)):
        factor = features[j, channel]
        for k in range(first, end):
            shades[k] += factor * grad[channel, k]


@njit(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _unweigh(ellipses, j, xs, ys, alphas, falloffs, shades, light, behind, weights, first, end):
    """Remove one Gaussian again: update light and what is behind, fill its weights, and return its gradients.

    The gradients are of centre, inverse covariance (xy counted once) and opacity. The compiler chooses the order of summation; it is the
    same in every run.
    """
    x, y, opacity = ellipses[j, CENTRE_X], ellipses[j, CENTRE_Y], ellipses[j, OPACITY]
    xx, xy, yy = ellipses[j, CONIC_XX], ellipses[j, CONIC_XY], ellipses[j, CONIC_YY]
    vx, vy, vxx, vxy, vyy, vo = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(first, end):
        alpha, falloff, shade = alphas[k], falloffs[k], shades[k]
        passed = 1 / (1 - alpha)
        before = light[k] * passed
        weight = alpha * before
        v_alpha = before * shade - behind[k] * passed
        light[k] = before
        behind[k] += weight * shade
        weights[k] = weight
        # No gradient where alpha was clamped to its maximum, or nothing was added.
        v_alpha = v_alpha if (opacity * falloff <= MAX_ALPHA) & (alpha > 0) else 0.0
        dx, dy = xs[k] - x, ys[k] - y
        v_sigma = -v_alpha * alpha
        vo += v_alpha * falloff
        vx -= v_sigma * (xx * dx + xy * dy)
        vy -= v_sigma * (xy * dx + yy * dy)
        vxx += v_sigma * 0.5 * dx * dx
        vxy += v_sigma * dx * dy
        vyy += v_sigma * 0.5 * dy * dy
    return vx, vy, vxx, vxy, vyy, vo


@njit(error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
def _gather(grad, weights, pair_features, pair, first, end):
    """Fill the gradients of a pair's features, sums of weight times gradient over its pixels."""
    for channel in range(len(grad)):
        total = weights.dtype.type(0)
        for k in range(first, end):
            total += weights[k] * grad[channel, k]
        pair_features[pair, channel] = total


@njit(error_model="numpy", fastmath={"contract"})
def _exponential(sigma):
    """exp(-sigma), exact up to rounding, with sigma clamped to 0 .. FARTHEST."""
    sigma = sigma if sigma < FARTHEST else FARTHEST
    sigma = sigma if sigma > 0 else 0.0
    x = sigma / 2**HALVINGS - MIDDLE
    c0, c1, c2, c3, c4, c5, c6, c7, c8, c9, c10, c11 = COEFFICIENTS
    value = c6 + x * (c7 + x * (c8 + x * (c9 + x * (c10 + x * c11))))
    value = c0 + x * (c1 + x * (c2 + x * (c3 + x * (c4 + x * (c5 + x * value)))))
    value *= value
    value *= value
    value *= value
    return value * value


@njit(error_model="numpy")
def _finished(light):
    """Whether no light is left at any pixel."""
    for k in range(PIXELS):  # noqa: SIM110, since Numba compiles no generators
        if not light[k] < 0:
            return False
    return True


@njit(error_model="numpy")
def _block(ellipses, features):
    """Memory for the ellipses and features of a block."""
    return np.empty((BLOCK, ellipses.shape[1])), np.empty((BLOCK, features.shape[1]), features.dtype)


@njit(error_model="numpy")
def _fetch(ellipses, features, gaussians, near_ellipses, near_features):
    """Copy the ellipses and features of a block of Gaussians."""
    for j in range(len(gaussians)):
        i = gaussians[j]
        for k in range(ellipses.shape[1]):
            near_ellipses[j, k] = ellipses[i, k]
        for k in range(features.shape[1]):
            near_features[j, k] = features[i, k]


@njit(error_model="numpy")
def _sides(tile, height, width):
    """First and end row and column of pixels of a tile."""
    columns = -(-width // TILE_WIDTH)
    top, left = tile // columns * TILE_HEIGHT, tile % columns * TILE_WIDTH
    return top, min(top + TILE_HEIGHT, height), left, min(left + TILE_WIDTH, width)


@njit(error_model="numpy")
def _centres(top, left):
    """x and y of the centres of a tile's pixels, row by row [px]."""
    xs, ys = np.empty(PIXELS), np.empty(PIXELS)
    for row in range(TILE_HEIGHT):
        for column in range(TILE_WIDTH):
            xs[row * TILE_WIDTH + column] = left + column + 0.5
            ys[row * TILE_WIDTH + column] = top + row + 0.5
    return xs, ys


@njit(error_model="numpy")
def _span(ellipses, i, top, bottom):
    """The pixels of a tile, as begin and end, in rows that an ellipse touches."""
    first, end = _rows(ellipses, i, top, bottom)
    return np.uint64((first - top) * TILE_WIDTH), np.uint64((max(end, first) - top) * TILE_WIDTH)


@njit(error_model="numpy")
def _pixels(low, high, first, end):
    """Pixels in first..end - 1 whose centre is in low..high, as begin and end; the slack of the reach covers rounding."""
    low, high = max(low, first), min(high, end)
    return max(first, math.ceil(low - 0.5)), min(end, math.floor(high + 0.5))


@njit(error_model="numpy")
def _rows(ellipses, i, top, bottom):
    """Rows of pixels in top..bottom - 1 that an ellipse touches, as begin and end."""
    half = math.sqrt(ellipses[i, REACH] * ellipses[i, CONIC_XX] / ellipses[i, DETERMINANT])
    return _pixels(ellipses[i, CENTRE_Y] - half, ellipses[i, CENTRE_Y] + half, top, bottom)


@njit(error_model="numpy")
def _fill_rectangle(ellipses, i, height, width, rectangles):
    """First and end row and column of the tiles that an ellipse's bounding box touches.

    It assigns number by number: to assign a tuple to a row, Numba spends two seconds compiling an error message.
    """
    for side in range(4):
        rectangles[i, side] = 0
    if ellipses[i, REACH] < 0:
        return
    half = math.sqrt(ellipses[i, REACH] * ellipses[i, CONIC_YY] / ellipses[i, DETERMINANT])
    top, bottom = _rows(ellipses, i, 0, height)
    left, right = _pixels(ellipses[i, CENTRE_X] - half, ellipses[i, CENTRE_X] + half, 0, width)
    if top < bottom and left < right:
        rectangles[i, 0], rectangles[i, 1] = top // TILE_HEIGHT, (bottom - 1) // TILE_HEIGHT + 1
        rectangles[i, 2], rectangles[i, 3] = left // TILE_WIDTH, (right - 1) // TILE_WIDTH + 1


@njit(error_model="numpy")
def _tile_rows(rectangles, i, width, first, end):
    """Rows of tiles of an ellipse's rectangle, as begin and end, that have some of the tiles first..end - 1."""
    columns = -(-width // TILE_WIDTH)
    return max(rectangles[i, 0], first // columns), min(rectangles[i, 1], -(-end // columns))


@njit(error_model="numpy")
def _tiles(ellipses, i, rectangles, tile_row, width, first, end):
    """Tiles of one row that an ellipse touches, as begin and end, within the tiles first..end - 1."""
    left, right = _tile_columns(ellipses, i, rectangles, tile_row, width)
    start = tile_row * -(-width // TILE_WIDTH)
    return max(start + left, first), min(start + right, end)


@njit(error_model="numpy")
def _tile_columns(ellipses, i, rectangles, tile_row, width):
    """Tiles of one row that an ellipse touches, as begin and end: exact, because both ellipse and row are convex.

    The ellipse is furthest right at dy = -(xy / yy) times its half width, and furthest left at the opposite. If that is outside the band
    of the row's pixel centres, the nearest border of the band counts.
    """
    top, bottom, first, end = rectangles[i]
    if bottom - top == 1 or end - first == 1:
        return first, end
    xx, xy, yy = ellipses[i, CONIC_XX], ellipses[i, CONIC_XY], ellipses[i, CONIC_YY]
    reach, determinant = ellipses[i, REACH], ellipses[i, DETERMINANT]
    low = tile_row * TILE_HEIGHT + 0.5 - ellipses[i, CENTRE_Y]
    high = low + TILE_HEIGHT - 1
    turn = -xy / yy * math.sqrt(reach * yy / determinant)
    at_right = min(max(turn, low), high)
    at_left = min(max(-turn, low), high)
    right = (math.sqrt(max(0.0, reach * xx - determinant * at_right * at_right)) - xy * at_right) / xx
    left = -(math.sqrt(max(0.0, reach * xx - determinant * at_left * at_left)) + xy * at_left) / xx
    begin, stop = _pixels(ellipses[i, CENTRE_X] + left, ellipses[i, CENTRE_X] + right, 0, width)
    if begin >= stop:
        return first, first
    return begin // TILE_WIDTH, (stop - 1) // TILE_WIDTH + 1
