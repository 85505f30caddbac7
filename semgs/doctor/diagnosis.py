"""Tests a scene's cameras against its images and depth maps, and names the mistake that explains what does not fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, final

import numpy as np

from semgs.data.scene import Scene
from semgs.doctor.misses import CAP_PX, fit_disparity, miss, pair_misses, triangulated_depth, triangulated_depths
from semgs.doctor.mistakes import (
    ALONG_RAY,
    BAD_DEPTH,
    DEPTH_UNIT,
    INVERSE_DEPTH,
    MILLIMETRES,
    MISTAKES,
    Given,
    Mistake,
    plausible,
)
from semgs.doctor.registered import unregistered
from semgs.doctor.rig import FileConvention, Rig, rig_of
from semgs.doctor.warps import DepthView, find_depth_views, warp_error
from semgs.sfm.matches import FEATURES, Matches, find_matches

FITS = 1.0
"""Cameras with a smaller error fit, and no mistake is looked for [px of the reduced images, or % of depth]."""

BAD = 5.0
"""Cameras with a larger error are wrong, even if no usual mistake explains it; with one in between they are slightly wrong."""

MANY, MOST = 20, 0.75
"""An error that nothing explains is believed if this share of the pairs with this many matches has one."""

EXPLAINS = 0.5
"""A mistake explains the data if undoing it leaves at most this share of the error."""

SLACK_PERCENT = 0.5
"""Undoing a mistake may not make depth maps disagree by more than this in addition."""

ALIKE, ALIKE_BY = 1.25, 0.25
"""Two mistakes explain the data equally well if their errors differ by less than this factor, or by less than this."""

ALIGN_INVERSE = "semgs reconstruct --depth maps --depth-meaning inverse"
"""What takes inverse depth as it is."""

Verdict = Literal["good", "slightly wrong", "suspicious", "cannot tell"]


@final
@dataclass(frozen=True, eq=False)
class Evidence:
    """What cameras are tested on.

    Attributes:
        matches: between images, with the measured depth of each.
        depth_views: measured depth of neighbouring frames. It replaces matches if there are none; else it guards against wrong ones.
    """

    matches: Matches
    depth_views: tuple[DepthView, ...] = ()

    @property
    def unit(self) -> str:
        """Of the error: "px" or "%"."""
        return "px" if len(self.matches) else "%"

    @property
    def depth(self) -> float:
        """The median of the measured depths [m]; NaN if too little was measured."""
        if len(self.matches):
            known = self.matches.depths[np.isfinite(self.matches.depths)]
            return float(np.median(known)) if self.matches.measured else np.nan
        return float(np.median(np.concatenate([view.points[:, 2] for view in self.depth_views])))

    def __bool__(self) -> bool:
        """Whether there is any."""
        return len(self.matches) > 0 or len(self.depth_views) > 1

    def error(self, rig: Rig) -> float:
        """How far cameras are from what was observed, in `unit`."""
        return miss(rig, self.matches) if len(self.matches) else warp_error(rig, self.depth_views)

    def error_where(self, rig: Rig, other: Rig) -> float:
        """The error on the pairs of frames for which another rig has poses too."""
        if not len(self.matches):
            return self.error(rig)
        posed = np.isfinite(other.poses).all((1, 2))[self.matches.pairs].all(1)
        return float(pair_misses(rig, self.matches)[posed].mean()) if posed.any() else np.inf

    def contradicts(self, rig: Rig) -> bool:
        """Whether most pairs of frames with many matches speak against cameras, or, without matches, depth maps do.

        Matches of repeated texture are wrong in some pairs and right in others, or few.
        """
        if not len(self.matches):
            return True
        many = np.bincount(self.matches.pair, minlength=len(self.matches.pairs)) >= MANY
        each = pair_misses(rig, self.matches)[many]
        return len(each) > 0 and float((each > FITS).mean()) >= MOST

    def fits_alone(self, rig: Rig) -> bool:
        """Whether cameras fit the matches if nothing had been measured."""
        return len(self.matches) > 0 and miss(rig, self.matches.without_depth()) <= FITS

    def depth_error(self, rig: Rig) -> float:
        """By how much depth maps disagree [%]; infinite without depth maps."""
        return warp_error(rig, self.depth_views) if len(self.depth_views) > 1 else np.inf


@final
@dataclass(frozen=True)
class Finding:
    """A mistake that explains the data.

    Attributes:
        mistake: which.
        error: that of the corrected cameras.
        rig: the corrected cameras.
    """

    mistake: Mistake
    error: float
    rig: Rig = field(repr=False)


@final
@dataclass(frozen=True)
class Diagnosis:
    """What the images and depth maps say about a scene's cameras.

    Attributes:
        verdict: "good", "slightly wrong", "suspicious", or "cannot tell".
        error: by which the given cameras miss matches, the mean over pairs of the median [px of the reduced images]; or, without matches, by
            which depth maps disagree [%]; NaN without evidence.
        findings: the mistakes that explain the data, the likeliest first; empty unless suspicious.
        undecided: usual mistakes that would not show in these images, so they cannot be excluded.
        given: the cameras as given.
        evidence: what they were tested on.
        far: the median distance at which the cameras put what both images of a pair show, if that is what is wrong [m]; NaN otherwise.
        depth_focal: the focal length of the depth camera over that of the images, if depth maps are not registered; NaN otherwise.
    """

    verdict: Verdict
    error: float
    findings: tuple[Finding, ...]
    undecided: tuple[Mistake, ...]
    given: Rig = field(repr=False)
    evidence: Evidence = field(repr=False)
    far: float = np.nan
    depth_focal: float = np.nan

    @property
    def distance(self) -> float:
        """The median distance at which the cameras put what both images of a pair show, by parallax alone [the scene's unit]; NaN if they miss the matches."""
        return triangulated_depth(self.given, self.evidence.matches) if self.evidence.fits_alone(self.given) else np.nan

    @property
    def depth_ratio(self) -> float:
        """The median of measured depth over the distance by parallax; NaN if the cameras miss the matches, few have depth, or it is inverse depth."""
        if not self.evidence.matches.measured or not self.evidence.fits_alone(self.given):
            return np.nan
        if self.finding is not None and self.finding.mistake is INVERSE_DEPTH:
            return np.nan
        ratios = self.evidence.matches.depths[:, 0] / triangulated_depths(self.given, self.evidence.matches)
        known = ratios[np.isfinite(ratios)]
        return float(np.median(known)) if len(known) >= MANY else np.nan

    @property
    def finding(self) -> Finding | None:
        """The likeliest mistake, None if there is none."""
        return self.findings[0] if self.findings else None

    def amount(self, error: float) -> str:
        """An error as text: "1.2 px", "20 % or more"."""
        unit = self.evidence.unit
        return f"{error:.1f} {unit}" if error < CAP_PX else f"{CAP_PX:.0f} {unit} or more"

    @property
    def sentence(self) -> str:
        """The verdict in a sentence or two."""
        return self._sentence(options=True)

    @property
    def without_options(self) -> str:
        """The same without the options of the command line that help."""
        return self._sentence(options=False)

    def _sentence(self, options: bool) -> str:
        """The verdict, with the options of the command line that help, or without."""
        if self.verdict == "cannot tell":
            if np.isfinite(self.error):
                return f"Cannot tell: the cameras miss matches by {self.amount(self.error)}, but the matches may be wrong, as those of repeated texture."
            return "Cannot tell: too few points are seen in two frames, or the camera does not move."
        if self.finding is not None and np.isfinite(self.far):
            return f"The cameras fit the images, but put what they show {self.far:,.0f} m away. Likely mistake: {self.finding.mistake.name}."
        if np.isfinite(self.depth_focal):
            return (
                f"The depth maps do not fit the images: they fit best as those of a camera with {self.depth_focal:.2f} times the focal length. "
                f"Likely mistake: {BAD_DEPTH.name}. Register them to the images first, for example with the sensor's aligned depth stream or "
                "depth_image_proc/register of ROS."
            )
        by = self.amount(self.error)
        matched = self.evidence.unit == "px"
        if self.verdict == "slightly wrong":
            if not matched:
                return f"The cameras or the depth maps are slightly wrong: depth maps disagree by {by}."
            if self.evidence.fits_alone(self.given):
                return f"The cameras fit the images. With the measured depth they miss matches by {by}: the depth maps or the distances between cameras are slightly wrong."
            said = (
                f"The cameras are slightly wrong, as from odometry or a rough calibration: they miss matches by {by}."
            )
            return f"{said} semgs reconstruct corrects such cameras." if options else said
        if self.verdict == "good" and self.error > FITS:
            agree = f"depth maps agree to {self.evidence.depth_error(self.given):.1f} %"
            return f"The cameras fit: {agree}. They miss matches by {by}, but the matches may be wrong, as those of repeated texture."
        if self.verdict == "good":
            return f"The cameras fit: {f'they miss matches by {by}' if matched else f'depth maps disagree by {by}'}."
        said = f"The cameras miss matches by {by}" if matched else f"Under these cameras, depth maps disagree by {by}"
        if self.finding is None:
            return f"{said}, and no usual mistake explains it."
        also = "".join(f", or {one.mistake.name} ({self.amount(one.error)})" for one in self.findings[1:])
        which = self.finding.mistake.name
        if self.finding.mistake is DEPTH_UNIT:
            hint = "; see --depth-unit" if options else ""
            which += f" (it fits if it is multiplied by {self.finding.rig.depth_unit:g}{hint})"
        if self.finding.mistake is ALONG_RAY:
            which += " (divide each depth by |K^-1 (u, v, 1)| of its pixel)"
        said = f"{said}. Likely mistake: {which}, {self.amount(self.finding.error)} when corrected{also}."
        if self.finding.mistake is INVERSE_DEPTH:
            said += " Convert them to depth in metres" + (f", or use {ALIGN_INVERSE}." if options else ".")
        return said


def diagnose(scene: Scene, frames: Sequence[int] | None = None, features: int = FEATURES) -> Diagnosis:
    """Test the cameras of a scene.

    Args:
        scene: the scene.
        frames: positions of the frames to use; None for a selection.
        features: the most features of a frame.

    Raises:
        InputError: an image or a depth map cannot be read.
    """
    matches = find_matches(scene, frames, features)
    evidence = Evidence(matches, find_depth_views(scene, frames))
    names = [frame.name for frame in scene.frames]
    return judge_cameras(rig_of(scene.frames), evidence, scene.layout, names, metric=scene.unit == "metric")


def judge_cameras(
    rig: Rig, evidence: Evidence, layout: str, names: Sequence[str], *, metric: bool = False
) -> Diagnosis:
    """Test cameras on evidence.

    Args:
        rig: the cameras as given.
        evidence: from their images and depth maps.
        layout: of the scene, which says how its files write poses.
        names: of the frames.
        metric: whether the scene says that its lengths are metres. Then matched points at distances that no room has show another unit.
    """
    if not evidence:
        return Diagnosis("cannot tell", np.nan, (), MISTAKES, rig, evidence)
    given = Given(
        rig,
        FileConvention.of(layout),
        tuple(names),
        rig.depth_unit * evidence.depth,
        evidence.error,
        fit_disparity(rig, evidence.matches),
    )
    before = given.error(rig)
    findings = _findings(given, evidence) if before > FITS else ()
    rival = min((one.error for one in findings if one.mistake is not BAD_DEPTH), default=np.inf)
    zoom = unregistered(rig, evidence.matches, evidence.depth_views, rival)
    if zoom is not None:
        ignored = replace(rig, depth_unit=np.nan)
        finding = Finding(BAD_DEPTH, given.error(ignored), ignored)
        return Diagnosis("suspicious", before, (finding,), (), rig, evidence, depth_focal=zoom.ratio)
    if findings:
        return Diagnosis("suspicious", before, findings, (), rig, evidence)
    if before > BAD and evidence.depth_error(rig) > FITS:
        if evidence.contradicts(rig):
            return Diagnosis("suspicious", before, (), (), rig, evidence)
        return Diagnosis("cannot tell", before, (), MISTAKES, rig, evidence)
    far = triangulated_depth(rig, evidence.matches) if metric and not evidence.matches.measured else np.nan
    if np.isfinite(far) and not plausible(far):
        metres = [one for one in MILLIMETRES.corrected(given) if plausible(triangulated_depth(one, evidence.matches))]
        if metres:
            finding = Finding(MILLIMETRES, given.error(metres[0]), metres[0])
            return Diagnosis("suspicious", before, (finding,), (), rig, evidence, far)
    limit = max(FITS, 2 * before)
    undecided = tuple(
        mistake
        for mistake in MISTAKES
        if not (mistake is MILLIMETRES and plausible(far))
        and any(given.error(one) <= limit for one in mistake.excluded_by(given))
    )
    verdict: Verdict = "slightly wrong" if FITS < before <= BAD else "good"
    return Diagnosis(verdict, before, (), undecided, rig, evidence)


def _findings(given: Given, evidence: Evidence) -> tuple[Finding, ...]:
    """The mistakes that explain the error of the given cameras, the likeliest first.

    Repeated texture gives wrong matches, so undoing a mistake must not make depth maps disagree. If the cameras fit the matches without depth, it is
    depth that is wrong, not their focal lengths and principal points.
    """
    depth_error, fits_alone = evidence.depth_error(given.rig), evidence.fits_alone(given.rig)

    def explains(one: Finding) -> bool:
        if fits_alone and not (
            np.array_equal(one.rig.focal, given.rig.focal) and np.array_equal(one.rig.centre, given.rig.centre)
        ):
            return False
        before = evidence.error_where(given.rig, one.rig)
        return one.error <= EXPLAINS * before and evidence.depth_error(one.rig) <= depth_error + SLACK_PERCENT

    found = [one for mistake in MISTAKES if (one := _best(mistake, given)) and explains(one)]
    if not found:
        before = given.error(given.rig)
        last = _best(BAD_DEPTH, given) if before > BAD and depth_error > FITS else None
        return (last,) if last and last.error <= EXPLAINS * before else ()
    best = min(one.error for one in found)
    return tuple(one for one in found if one.error <= max(ALIKE * best, best + ALIKE_BY))


def _best(mistake: Mistake, given: Given) -> Finding | None:
    """The corrected cameras that fit best if a mistake was made; None if it cannot have been made."""
    tried = [Finding(mistake, given.error(rig), rig) for rig in mistake.corrected(given)]
    return min(tried, key=lambda one: one.error, default=None)
