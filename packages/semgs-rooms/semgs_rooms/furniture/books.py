"""Books for the boards of a shelf: boxes with generated spines."""

from __future__ import annotations

import colorsys
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float64, Int, UInt8

from semgs_rooms.furniture.kinds import Random
from semgs_rooms.furniture.surfaces import Surface, box

SPINES, ROWS = 32, 2
"""Number of spines in the texture, and of rows of spines."""
SIDE, SPINE_HEIGHT = 256, 96
"""Side of the texture, and height of a spine in it [px]."""
PAPER = (228, 220, 200)
STEP = 0.01
"""Step along a shelf at which its boards are searched for [m]."""
LOWEST = 0.16
"""Minimum height of a compartment for books [m]."""
NARROWEST = 0.15
"""Minimum width of a compartment for books [m]."""
FULL = 0.9
"""Share of compartments that contain books."""


def books_on(shelf: Surface, rng: Random) -> Surface | None:
    """Books on the boards of a shelf with front = -y; None if none of its boards has books."""
    lowest, highest = box([shelf])
    vertices: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    uv: list[np.ndarray] = []
    for left, right, board, roof in compartments(shelf):
        if rng.random() > FULL:
            continue
        tallest = min(roof - board - 0.02, rng.uniform(0.2, 0.31))
        deepest = min(highest[1] - lowest[1] - 0.05, rng.uniform(0.14, 0.22))
        front = lowest[1] + 0.02 + rng.uniform(0, 0.03)
        end = left + (right - left) * (rng.uniform(0.55, 1) if rng.random() < 0.6 else 1) - 0.02
        x = left + 0.012
        while (thick := rng.uniform(0.012, 0.05)) + x <= end:
            size = np.array([thick, deepest * rng.uniform(0.85, 1), tallest * rng.uniform(0.72, 1)])
            corner = np.array([x, front + rng.uniform(0, 0.012), board + 0.001])
            faces.append(BOOK_FACES + 16 * len(vertices))
            vertices.append(corner + BOOK * size)
            uv.append(_spine_uv(int(rng.integers(SPINES))))
            x += thick + 0.001 + (rng.uniform(0.03, 0.1) if rng.random() < 0.05 else 0)
    if not vertices:
        return None
    return Surface("books", np.concatenate(vertices), np.concatenate(faces), np.concatenate(uv), spines(rng))


def compartments(shelf: Surface) -> list[tuple[float, float, float, float]]:
    """Free rectangles between boards and uprights, seen from the front: left, right, board, roof [m].

    A vertical line through the shelf is free between two surfaces that are farther apart than the height of a book. Adjacent lines
    with the same gap form a rectangle, which uprights divide.
    """
    lowest, highest = box([shelf])
    corners = shelf.vertices[shelf.faces]
    depth = float(lowest[1] + 0.45 * (highest[1] - lowest[1]))
    gaps: list[tuple[float, float, float, float]] = []
    unfinished: dict[tuple[float, float], tuple[float, float]] = {}
    for x in np.arange(lowest[0] + STEP, highest[0] - STEP / 2, STEP).tolist():
        still = {}
        for board, roof in pairwise(_crossings(corners, (x, depth, None))):
            if roof - board <= LOWEST:
                continue
            before = next((gap for gap in unfinished if abs(gap[0] - board) + abs(gap[1] - roof) < 0.02), (board, roof))
            still[before] = (unfinished[before][0] if before in unfinished else x, x)
        gaps += [(*span, *gap) for gap, span in unfinished.items() if gap not in still]
        unfinished = still
    gaps += [(*span, *gap) for gap, span in unfinished.items()]
    pieces = []
    for left, right, board, roof in gaps:
        cuts = [x for x in _crossings(corners, (None, depth, (board + roof) / 2)) if left < x < right]
        spans = pairwise((left, *cuts, right))
        pieces += [(start, end, board, roof) for start, end in spans if end - start > NARROWEST]
    return pieces


def _crossings(
    corners: Float64[np.ndarray, "t 3 3"], line: tuple[float | None, float | None, float | None]
) -> list[float]:
    """Where a line along the axis that is None crosses triangles, ascending and rounded to millimetres [m]."""
    along = line.index(None)
    u, v = (axis for axis in range(3) if axis != along)
    flat = corners[..., (u, v)] - np.array((line[u], line[v]), dtype=np.float64)
    a, b, c = flat[:, 0], flat[:, 1], flat[:, 2]
    weights = np.stack([p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((b, c), (c, a), (a, b))], axis=1)
    area = weights.sum(axis=1)
    met = (np.abs(area) > 1e-12) & ((weights >= 0).all(axis=1) | (weights <= 0).all(axis=1))
    places = (weights[met] * corners[met][..., along]).sum(axis=1) / area[met]
    return np.unique(np.round(places, 3)).tolist()


def _book() -> tuple[Float64[np.ndarray, "16 3"], Int[np.ndarray, "8 3"]]:
    """Spine, covers and top of a unit book whose spine faces -y."""
    spine = [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)]
    left = [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)]
    right = [(1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)]
    top = [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    faces = [(4 * k, 4 * k + j, 4 * k + j + 1) for k in range(4) for j in (1, 2)]
    return np.array([*spine, *left, *right, *top], dtype=np.float64), np.array(faces)


BOOK, BOOK_FACES = _book()


def _spine_uv(number: int) -> Float64[np.ndarray, "16 2"]:
    """Texture coordinates of a book: its spine, one of the spine's colours for the covers, paper for the top."""
    per_row = SPINES // ROWS
    left, right = (np.array([number % per_row, number % per_row + 1]) / per_row) + [0.004, -0.004]
    top = (number // per_row) * SPINE_HEIGHT / SIDE + 0.01
    bottom = top + SPINE_HEIGHT / SIDE - 0.02
    spine = [(left, bottom), (right, bottom), (right, top), (left, top)]
    cover = [(left + 0.002, bottom - 0.01)] * 8
    paper = [(0.1, 0.98), (0.3, 0.98), (0.3, 0.8), (0.1, 0.8)]
    return np.array([*spine, *cover, *paper])


def spines(rng: Random) -> UInt8[np.ndarray, "h w 3"]:
    """A texture of spines, with paper below them."""
    picture = np.full((SIDE, SIDE, 3), PAPER, np.uint8)
    picture[ROWS * SPINE_HEIGHT + 2 :: 3] = [round(0.9 * c) for c in PAPER]
    width = SIDE * ROWS // SPINES
    for number in range(SPINES):
        x, y = number % (SPINES // ROWS) * width, number // (SPINES // ROWS) * SPINE_HEIGHT
        colour = np.array(colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.05, 0.8), rng.uniform(0.15, 0.95))) * 255
        if rng.random() < 0.2:
            colour[:] = rng.uniform(200, 245)
        spine = picture[y : y + SPINE_HEIGHT, x : x + width]
        spine[:] = colour
        ink = (235, 225, 190) if colour.sum() < 380 else (40, 36, 34)
        if rng.random() < 0.8:
            spine[20 + int(rng.integers(10)) : 55 + int(rng.integers(25)), 5:10] = ink
        for band, share in ((8, 0.5), (84, 0.5)):
            if rng.random() < share:
                spine[band : band + 4] = ink
    return cv2.GaussianBlur(picture, (0, 0), 0.5)
