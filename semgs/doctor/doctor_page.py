"""The page of `semgs doctor`: the verdict, matches with their epipolar lines, the cameras from two directions, and coverage."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from semgs._version import __version__
from semgs.data.scene import Scene
from semgs.doctor.diagnosis import Diagnosis
from semgs.doctor.facts import coverage
from semgs.doctor.misses import epipolar_line, pair_misses
from semgs.doctor.rig import Rig, undistorted_from_pinhole
from semgs.figures import html_page as page
from semgs.figures.view_images import please_note
from semgs.files.images.colours import opencv_palette
from semgs.files.text import percent

PAIRS = 4
"""Pairs of images on the page."""

SHOWN = 12
"""Matches shown in each."""

WIDTH_PX = 480
"""Images are shown at most this wide."""

PLOT_PX = 420
MARGIN_PX = 12

PYRAMID = 0.3
"""Length of the pyramid of a camera, as a share of how far the cameras reach."""

MOST_REACH = 20.0
"""Points are shown up to this many times the reach of the cameras."""

LEAST_UP = 0.3
"""If the mean of the images' upward directions is shorter, they do not agree about up."""


def doctor_page(scene: Scene, found: Diagnosis, facts: tuple[tuple[str, str], ...]) -> str:
    """The page as self-contained HTML.

    Args:
        scene: the scene.
        found: what was found.
        facts: what was understood of the scene.

    Raises:
        InputError: an image cannot be read.
    """
    corrected = found.finding.rig if found.finding else None
    headlines = [page.Headline(found.verdict, "verdict")]
    if np.isfinite(found.error):
        headlines.append(page.Headline(found.amount(found.error), "error of the given cameras"))
    if found.finding:
        headlines.append(page.Headline(found.amount(found.finding.error), "error when corrected"))
    notes = [f"Not excluded, because it would not show here: {one.name}." for one in found.undecided]
    sections = [page.Section("The scene", "", (page.Facts(facts),))]
    if len(found.evidence.matches):
        sections.append(page.Section("Matches", LEAD, tuple(_galleries(scene, found, corrected))))
        sections.append(page.Section("All pairs", "", (_pairs(scene, found, corrected),), folded=True))
    plots = _cameras(found.given, found, "given") + (
        [] if corrected is None else _cameras(corrected, found, "corrected")
    )
    sections.append(page.Section("Cameras", CAMERAS, (page.Gallery("Positions and directions", "", tuple(plots)),)))
    bars = tuple(page.Bar(name, BAR, share, percent(share)) for name, share in coverage(scene))
    sections.append(page.Section("Coverage", COVERAGE, (page.Bars(bars),), folded=True))
    return page.html_page(
        title=scene.name,
        lead=found.sentence,
        headlines=headlines,
        sections=[*please_note(scene.notes), *sections, *([page.Section("Not excluded", "", (page.Notes(tuple(notes)),), folded=True)] if notes else [])],
        foot=f"Made by semgs {__version__}.",
    )  # fmt: skip


LEAD = (
    "Each point on the left is the same as the one of its colour on the right. The line is where the cameras allow it to be: if they are right, "
    "the points on the right are on their lines."
)


CAMERAS = (
    "Each pyramid is a camera: its tip is the position, its base is the image. The first frame is red, and a line joins the frames in the file's order. "
    "Grey points are matches with measured depth. Up is where most images have it."
)

COVERAGE = "How much of what each frame sees is also seen by another one, under the given cameras."

BAR = (40, 80, 160)


def _worst_first(found: Diagnosis) -> np.ndarray:
    """The pairs to show: from the largest miss to the smallest."""
    return np.argsort(-np.nan_to_num(pair_misses(found.given, found.evidence.matches), nan=-1.0))


def _galleries(scene: Scene, found: Diagnosis, corrected: Rig | None) -> list[page.Gallery]:
    """The pairs that the given cameras miss most."""
    shown = []
    for index in _worst_first(found)[:PAIRS]:
        i, j = (int(frame) for frame in found.evidence.matches.pairs[index])
        pictures = [page.Picture(_epipolar(scene, found, found.given, int(index)), "given cameras", lossy=True)]
        if corrected is not None and np.isfinite(corrected.poses[[i, j]]).all():
            pictures.append(
                page.Picture(_epipolar(scene, found, corrected, int(index)), "corrected cameras", lossy=True)
            )
        shown.append(page.Gallery(f"{scene.frames[i].name} and {scene.frames[j].name}", "", tuple(pictures)))
    return shown


def _epipolar(scene: Scene, found: Diagnosis, rig: Rig, index: int) -> UInt8[np.ndarray, "h w 3"]:
    """Two images side by side, with some of their matches and the epipolar lines in the second."""
    matches = found.evidence.matches
    i, j = (int(frame) for frame in matches.pairs[index])
    sides, scales = [], []
    for frame in (scene.frames[i], scene.frames[j]):
        image = frame.read_undistorted()
        scale = min(1.0, WIDTH_PX / image.shape[1])
        size = (max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale)))
        sides.append(np.ascontiguousarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA)))
        scales.append(np.diag((scale, scale, 1.0)) @ undistorted_from_pinhole(frame.lens))
    points = matches.points[matches.pair == index]
    points = points[np.linspace(0, len(points) - 1, min(SHOWN, len(points))).round().astype(int)]
    palette = opencv_palette(cv2.COLORMAP_HSV)[np.linspace(0, 220, len(points)).round().astype(int)]
    for (a, b), colour in zip(points, palette.tolist(), strict=True):
        line = _shown(epipolar_line(rig, i, j, a), scales[1])
        for start, end in pairwise(line):
            if np.isfinite((start, end)).all() and np.abs((start, end)).max() < 1e4:
                cv2.line(sides[1], _rounded(start), _rounded(end), colour, 1, cv2.LINE_AA)
        for side, at, scale in ((sides[0], a, scales[0]), (sides[1], b, scales[1])):
            cv2.circle(side, _rounded(_shown(at[None], scale)[0]), 4, colour, -1, cv2.LINE_AA)
            cv2.circle(side, _rounded(_shown(at[None], scale)[0]), 4, (0, 0, 0), 1, cv2.LINE_AA)
    height = max(side.shape[0] for side in sides)
    return np.concatenate([np.pad(side, ((0, height - len(side)), (0, 4), (0, 0))) for side in sides], axis=1)


def _shown(points: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Points [n 2] as in `Matches` in the shown image, where the first pixel's centre is at 0 [px]."""
    return (np.column_stack((points, np.ones(len(points)))) @ scale.T)[:, :2] - 0.5


def _rounded(point: np.ndarray) -> tuple[int, int]:
    """A pixel."""
    column, row = np.rint(point).astype(int).tolist()
    return column, row


def _pairs(scene: Scene, found: Diagnosis, corrected: Rig | None) -> page.Table:
    """The pairs with their matches and misses."""
    matches = found.evidence.matches
    before = pair_misses(found.given, matches)
    after = None if corrected is None else pair_misses(corrected, matches)
    counts = np.bincount(matches.pair, minlength=len(matches.pairs))
    rows = []
    for index in _worst_first(found):
        names = [scene.frames[int(frame)].name for frame in matches.pairs[index]]
        row = (*names, str(counts[index]), _px(before[index]))
        rows.append(row if after is None else (*row, _px(after[index])))
    head = ("frame", "frame", "matches", "missed by, px")
    return page.Table(head if after is None else (*head, "when corrected, px"), tuple(rows))


def _px(miss: float) -> str:
    """A miss as text."""
    return f"{miss:.1f}" if np.isfinite(miss) else "no pose"


def _cameras(rig: Rig, found: Diagnosis, whose: str) -> list[page.Picture]:
    """The cameras with what they measured, from above and from the side."""
    poses = rig.poses[np.isfinite(rig.poses).all((1, 2))]
    points = _measured_points(rig, found)
    across, ahead, up = _axes(poses)
    return [
        page.Picture(_drawn(rig, points, np.stack((across, ahead))), f"{whose} cameras, from above"),
        page.Picture(_drawn(rig, points, np.stack((across, -up))), f"{whose} cameras, from the side"),
    ]


def _axes(poses: Float64[np.ndarray, "n 4 4"]) -> Float64[np.ndarray, "3 3"]:
    """Rows: the direction in which the cameras move most, one that is square to it, and up as most images have it."""
    centres = poses[:, :3, 3] - poses[:, :3, 3].mean(0)
    up = -poses[:, :3, 1].mean(0)
    if np.linalg.norm(up) < LEAST_UP:  # the cameras do not agree about up
        up = np.linalg.svd(np.concatenate((centres, poses[:, :3, 2])))[2][2]
    up = up / np.linalg.norm(up)
    # With the directions of view, a straight path up has a width too.
    level = np.concatenate((centres, 1e-3 * poses[:, :3, 0]))
    across = np.linalg.svd(level - np.outer(level @ up, up))[2][0]
    return np.stack((across, np.cross(across, up), up))


def _measured_points(rig: Rig, found: Diagnosis) -> Float64[np.ndarray, "m 3"]:
    """Where cameras put the matches whose depth was measured."""
    matches = found.evidence.matches
    frames = matches.pairs[matches.pair][:, 0]
    rays = (matches.points[:, 0] - rig.centre[frames]) / rig.focal[frames]
    depths = rig.z_depths(matches.depths[:, 0], rays, frames)
    places = np.column_stack((rays, np.ones(len(rays)))) * depths[:, None]
    places = np.einsum("mij,mj->mi", rig.poses[frames, :3, :3], places) + rig.poses[frames, :3, 3]
    return places[np.isfinite(places).all(1)]


def _drawn(
    rig: Rig, points: Float64[np.ndarray, "m 3"], axes: Float64[np.ndarray, "2 3"]
) -> UInt8[np.ndarray, "h w 3"]:
    """Points and pyramids of the cameras along two axes, to the right and down."""
    posed = np.flatnonzero(np.isfinite(rig.poses).all((1, 2)))
    centres = rig.poses[posed, :3, 3]
    reach = float(np.linalg.norm(centres - centres.mean(0), axis=1).max()) or 1.0
    points = points[np.linalg.norm(points - centres.mean(0), axis=1) < MOST_REACH * reach]
    around = [centres, *([np.quantile(points, (0.02, 0.98), axis=0)] if len(points) else [])]
    shown = np.concatenate(around) @ axes.T
    half = (shown.max(0) - shown.min(0)).max() / 2
    size = PYRAMID * max(reach, 0.4 * half)
    scale = (PLOT_PX / 2 - MARGIN_PX) / (half + size)

    def flat(places: np.ndarray) -> np.ndarray:
        return PLOT_PX / 2 + scale * (places @ axes.T - (shown.max(0) + shown.min(0)) / 2)

    canvas = np.full((PLOT_PX, PLOT_PX, 3), 255, np.uint8)
    for place in flat(points):
        cv2.circle(canvas, _rounded(place), 1, (170, 170, 170), -1, cv2.LINE_AA)
    for start, end in pairwise(flat(centres)):
        cv2.line(canvas, _rounded(start), _rounded(end), (190, 190, 190), 1, cv2.LINE_AA)
    for index in posed[::-1]:
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * rig.sizes[index]
        rays = np.column_stack(((corners - rig.centre[index]) / rig.focal[index], np.ones(4)))
        rays /= np.linalg.norm(rays, axis=1).max()
        base = flat(size * rays @ rig.poses[index, :3, :3].T + rig.poses[index, :3, 3])
        apex = flat(rig.poses[index, :3, 3])
        colour = (200, 30, 30) if index == posed[0] else (40, 80, 160)
        for corner, following in zip(base, np.roll(base, -1, axis=0), strict=True):
            cv2.line(canvas, _rounded(apex), _rounded(corner), colour, 1, cv2.LINE_AA)
            cv2.line(canvas, _rounded(corner), _rounded(following), colour, 1, cv2.LINE_AA)
        cv2.circle(canvas, _rounded(apex), 3, colour, -1, cv2.LINE_AA)
    return canvas
