"""The page of `semgs doctor`: the verdict, matches with their epipolar lines, and the cameras from above."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import UInt8

from semgs._version import __version__
from semgs.data.scene import Scene
from semgs.doctor.diagnosis import Diagnosis
from semgs.doctor.facts import coverage
from semgs.doctor.misses import epipolar_line, pair_misses
from semgs.doctor.rig import Rig, undistorted_from_pinhole
from semgs.figures import page
from semgs.figures.numbers import percent
from semgs.figures.views import please_note
from semgs.files.colours import opencv_palette

PAIRS = 4
"""Pairs of images on the page."""

SHOWN = 12
"""Matches shown in each."""

WIDTH_PX = 480
"""Images are shown at most this wide."""

PLOT_PX = 420
MARGIN_PX = 40


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
    plots = [page.Picture(_from_above(found.given), "given cameras")]
    if corrected is not None:
        plots.append(page.Picture(_from_above(corrected), "corrected cameras"))
    sections.append(page.Section("Cameras", ABOVE, (page.Gallery("Positions and directions", "", tuple(plots)),)))
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


ABOVE = "Seen along the direction in which they move least; the first frame is red."

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


def _from_above(rig: Rig) -> UInt8[np.ndarray, "h w 3"]:
    """Positions and directions of the cameras, in the plane in which they move most."""
    poses = rig.poses[np.isfinite(rig.poses).all((1, 2))]
    centres = poses[:, :3, 3] - poses[:, :3, 3].mean(0)
    # With the directions of view, a straight path has a plane too.
    spread = np.linalg.norm(centres, axis=1).max() or 1.0
    _, _, axes = np.linalg.svd(np.concatenate((centres / spread, 0.5 * poses[:, :3, 2])))
    flat = centres @ axes[:2].T / spread
    ahead = flat + 0.25 * poses[:, :3, 2] @ axes[:2].T
    scale = (PLOT_PX / 2 - MARGIN_PX) / max(np.abs(np.concatenate((flat, ahead))).max(), 1e-9)
    canvas = np.full((PLOT_PX, PLOT_PX, 3), 255, np.uint8)
    at, to = (PLOT_PX / 2 + scale * one for one in (flat, ahead))
    for start, end in pairwise(at):
        cv2.line(canvas, _rounded(start), _rounded(end), (200, 200, 200), 1, cv2.LINE_AA)
    for index, (start, end) in enumerate(zip(at, to, strict=True)):
        colour = (200, 30, 30) if index == 0 else (40, 80, 160)
        cv2.arrowedLine(canvas, _rounded(start), _rounded(end), colour, 2, cv2.LINE_AA, tipLength=0.25)
        cv2.circle(canvas, _rounded(start), 4, colour, -1, cv2.LINE_AA)
    return canvas
