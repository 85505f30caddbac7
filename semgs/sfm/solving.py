"""Cameras of photos by COLMAP's structure from motion, as pycolmap runs it on CPUs.

Features are SIFT. All pairs of photos are matched, of a clip those that are near in time. Then photos are added one by one (incremental mapping); if that
leaves some out, all are solved at once (global mapping), and the result with more photos counts. Of two photos, incremental mapping is two-view geometry with
bundle adjustment, and the focal length is held: two photos do not tell it reliably. They are refused if their matches do not determine how the camera moved.
https://colmap.github.io
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.files.errors import InputError
from semgs.files.paths import check_utf8
from semgs.files.text import listed
from semgs.runtime.notes import Kind, Note
from semgs.sfm.lens_groups import BETTER, copy_with_cameras, describe_groups, group_by_focal, may_be_several
from semgs.sfm.photos import PhotoSet, UprightPhoto
from semgs.sfm.pycolmap_library import pycolmap
from semgs.sfm.reasons import MOST_DEG, TURNED, direction_error_deg, matches_of, parallax_px, why_not

ALL_PLACED = Kind("The cameras of {placed} of {count} photos were estimated from the photos.", "")
SOME_PLACED = Kind(
    "The cameras of {placed} of {count} photos were estimated from the photos.",
    "Only {placed} of {count} photos could be placed; the others share too little with them. Take more steps to the side, and let photos overlap by half.",
)
NOT_PLACED = Kind("These do not overlap enough with the others and are left out: {names}.")
FOCAL_LENGTH = Kind("The focal length is {focal}.", "")
SOLVED = Kind("The focal length is {focal}, solved{start}.")
SOLVED_OF_FEW = Kind(
    "The focal length is {focal}, solved. So few photos can get it wrong: if you know it, give it with --focal.",
    "The focal length is {focal}, solved. So few photos can get it wrong.",
)
FOCAL_IS_A_GUESS = "The photos do not say how strongly the lens magnifies, so depths and sizes are a guess. A third photo helps, and so do the original files, which name the lens."
GUESSED_OF_TWO = Kind(
    "The focal length is a guess: {focal}. Two photos do not show it; give it with --focal, or add a third photo.",
    FOCAL_IS_A_GUESS,
)
GUESSED = Kind(
    "The focal length is a guess: {focal}. The photos do not show it: {low:.0f} to {high:.0f} px fit equally well. Give it with --focal, or show things at several depths.",
    FOCAL_IS_A_GUESS,
)

SEED = 0
LARGEST_SIDE, FEATURES = 1600, 4096
CONTRAST = 0.002
"""A third of COLMAP's peak threshold: rooms have few corners."""

GUESS = 0.8
"""Focal length of photos that do not say it, over the longer side: 64 degrees across, a phone's main camera."""

STARTS = (0.5, 0.65, GUESS, 1.0, 1.3)
"""Where to start if few photos have an unknown focal length, over the longer side: 90 to 42 degrees across. From one start alone, one in four sets of six photos
ends at a wrong focal length, which another start does not."""

SHARE = 1 / 3
"""Models with fewer than this share of the observations of the largest one do not count: few observations can fit anything."""

EQUAL = 1.05
"""Models whose reprojection errors differ by less than this factor fit equally well."""

UNSURE = 1.25
"""If the focal lengths of models that fit equally well differ by more than this factor, the photos do not show it."""

PLAUSIBLE = (0.3, 3.0)
"""Solved focal lengths over the longer side: 118 to 19 degrees across. Those of EXIF or the user may be shorter or longer."""

NEARLY_ALL = 0.9
"""A model that fits better explains at least this share of the observations of the other."""

REGROUPED = 3
"""Photos are grouped by their focal lengths at most so often."""

NEAR_KNOWN = 1.4
"""Solved focal lengths may differ from those of EXIF by this factor."""

PIXELS_OFF = 4.0
"""A match may be this far from its epipolar line, on an image with a longer side of `LARGEST_SIDE` [px]; at least half of it on small ones."""

GUIDED = 800
"""Images up to this longer side [px] are matched again along epipolar lines: they have few features, and large ones would take four times as long."""

DISTORTED = 8
"""With at least this many photos, radial distortion is solved for; with fewer it would fit noise."""

FIRST_PX = (4.0, 1.0)
"""A match of the first two photos may be this far from what fits [px]. COLMAP's 4 px take a small photo's parallax for a plane's or for none, 1 px takes some
blurred ones apart: of two photos, both are tried, and the better fit counts."""

LEAST_POINTS = 30
"""Fewer points do not hold cameras in place."""

LEAST_ANGLE_DEG = 1.0
"""Rays to the points have to meet at this angle in the median, or the cameras hardly moved."""

SECONDS_PER_PHOTO, SECONDS_PER_PAIR, SECONDS_PER_CAMERA = 2.5, 0.09, 0.25
"""Of one core to find a photo's features at `LARGEST_SIDE`, to match two photos, and to add a camera each time that all are solved, which one thread does. Small photos take less."""


@dataclass(frozen=True, eq=False)
class PosedPhoto:
    """A photo with its estimated camera.

    Attributes:
        name: as of `UprightPhoto`.
        lens: focal length, principal point in the middle, radial distortion.
        world_from_camera: pose [4 4], OpenCV axes.
        original: as of `UprightPhoto`.
    """

    name: str
    lens: Lens
    world_from_camera: np.ndarray
    original: str = ""


@dataclass(frozen=True, eq=False)
class Solution:
    """Estimated cameras of a set of photos.

    Attributes:
        photos: those that could be registered, in the order of the set.
        points: sparse points [n 3] in the world.
        colours: of the points, uint8 [n 3].
        model: the same as a `pycolmap.Reconstruction`, to write it in COLMAP's format; None if the cameras are not COLMAP's.
        unit: "metric" or "unknown".
        notes: what the user should know.
    """

    photos: tuple[PosedPhoto, ...]
    points: np.ndarray
    colours: np.ndarray
    model: Any
    unit: str = "unknown"
    notes: tuple[str, ...] = ()


def expected_seconds(photos: Sequence[UprightPhoto], ordered: bool, cores: int, focal_given: bool = False) -> float:
    """About how long `solve` takes. If the photos turn out to have several lenses, each grouping takes as long as one solving in addition."""
    count = len(photos)
    pairs = sum(1 for i in range(count) for j in range(i + 1, count) if not ordered or j - i <= 10)
    longer = max(max(photo.size) for photo in photos)
    finding = SECONDS_PER_PHOTO * count * min(1.0, (longer / LARGEST_SIDE) ** 2)
    matching = SECONDS_PER_PAIR * pairs * min(1.0, (longer / 640) ** 2)
    held = focal_given or count == 2
    solved = len(STARTS) if _tries_starts(photos, held) else len(FIRST_PX) if count == 2 else 1
    solved += _frees_each(photos, ordered, held)
    return 1 + (finding + matching) / cores + solved * SECONDS_PER_CAMERA * count * min(1.0, longer / 1000)


def _tries_starts(photos: Sequence[UprightPhoto], held: bool) -> bool:
    """Whether cameras are solved from each of `STARTS`."""
    known = all(photo.focal_px is not None for photo in photos)
    return not (held or known or len(photos) >= DISTORTED)


def _frees_each(photos: Sequence[UprightPhoto], ordered: bool, held: bool) -> bool:
    """Whether cameras are solved once more with a focal length for each photo."""
    return not held and may_be_several(photos, ordered)


def solve(photos: PhotoSet, upright: Sequence[UprightPhoto], focal_given: bool = False) -> Solution:
    """Estimate the cameras of photos.

    Args:
        photos: the set.
        upright: its photos, with their focal lengths.
        focal_given: whether these are from the user, and are held.

    Raises:
        InputError: fewer than two photos, or of three or more fewer than three, could be registered, and the error says why; or a name is not UTF-8.
        ImportError: pycolmap is not installed.
    """
    library = pycolmap()
    for path in (photos.folder, *(Path(photo.name) for photo in upright)):
        check_utf8(path, "pycolmap")
    held = focal_given or len(upright) == 2
    with TemporaryDirectory(prefix="semgs-") as temporary:
        work = Path(temporary)
        database = work / "features.db"
        library.set_random_seed(SEED)
        _extract(database, photos.folder, upright)
        _match(database, photos.ordered, min(LARGEST_SIDE, max(max(photo.size) for photo in upright)))
        if len(upright) == 2:
            models = [one for first in FIRST_PX for one in _models(database, photos.folder, work, held, upright, first)]
        elif _tries_starts(upright, held):
            models = []
            for start in STARTS:
                _start_at(database, start)
                models += _models(database, photos.folder, work, held, upright)
        else:
            models = _models(database, photos.folder, work, held, upright)
        equal = best(models)
        groups = None
        if _frees_each(upright, photos.ordered, held):
            equal, groups = _with_several_lenses(database, photos.folder, work, upright, equal)
        model = equal[0] if equal else None
        if model is None or _median_angle_deg(model) < LEAST_ANGLE_DEG or not _shows_motion(model, upright):
            reason = why_not(database, model is not None and model.num_reg_images() > 0)
            raise InputError(
                photos.path,
                "photos whose cameras can be estimated",
                f"{reason.found} ({len(upright)} photos)",
                advice=reason.hint,
                page=f"SemGS could not work out where they were taken: {reason.found}. {reason.hint}",
            )
    return _solution(equal, photos, upright, held, focal_given, groups)


def _with_several_lenses(
    database: Path, folder: Path, work: Path, upright: Sequence[UprightPhoto], shared: Sequence[Any]
) -> tuple[list[Any], dict[str, tuple] | None]:
    """The models with one focal length for all photos of a size, and None; or, if that fits clearly better, with one for each group of photos, and the groups.

    One focal length is an assumption: it is freed once for each photo, and the errors are compared.
    """
    own = {photo.name: (photo.size, photo.focal_px, "" if photo.focal_px else photo.name) for photo in upright}
    copy_with_cameras(database, work / "each.db", folder, own, {})
    each = best(_models(work / "each.db", folder, work, False, upright))
    if not each or (shared and not _fits_better(each[0], shared[0])):
        return list(shared), None
    found, groups = each, group_by_focal(each[0], upright)
    for number in range(REGROUPED):
        copy = work / f"groups{number}.db"
        copy_with_cameras(database, copy, folder, groups, _focal_of(found[0], groups))
        found = best(_models(copy, folder, work, False, upright))
        if not found or (shared and not _fits_better(found[0], shared[0])):
            return list(shared), None
        again = group_by_focal(found[0], upright)
        if len(set(again.values())) == len(set(groups.values())):
            break
        groups = again  # together, groups may turn out to have the same focal length
    if shared and len(set(groups.values())) == len({(photo.size, photo.focal_px) for photo in upright}):
        return list(shared), None
    return found[:1], groups


def _focal_of(model: Any, groups: Mapping[str, tuple]) -> dict[tuple, float]:
    """The median focal length in a model of each group of photos whose focal length is not known [px]."""
    focal: dict[tuple, list[float]] = {}
    for image in model.images.values():
        if image.has_pose and len(groups[image.name]) > 2:
            focal.setdefault(groups[image.name], []).append(model.cameras[image.camera_id].params[0])
    return {group: float(np.median(values)) for group, values in focal.items()}


def _fits_better(model: Any, other: Any) -> bool:
    """Whether a model has more photos than another, or as many with clearly smaller reprojection errors and nearly as many observations."""
    photos, others = model.num_reg_images(), other.num_reg_images()
    if photos != others:
        return bool(photos > others)
    error, before = (one.compute_mean_reprojection_error() for one in (model, other))
    return bool(
        error <= BETTER * before and model.compute_num_observations() >= NEARLY_ALL * other.compute_num_observations()
    )


def posed_photos(model: Any, upright: Sequence[UprightPhoto]) -> tuple[PosedPhoto, ...]:
    """The registered ones of some photos in a pycolmap model. Its pixels and camera axes are ours; its poses are world to camera."""
    found, originals = {}, {photo.name: photo.original for photo in upright}
    for image in model.images.values():
        if image.has_pose:
            camera, world_from_camera = model.cameras[image.camera_id], np.eye(4)
            world_from_camera[:3] = image.cam_from_world().inverse().matrix()
            focal, cx, cy, *radial = camera.params.tolist()
            size = camera.height, camera.width
            lens = Lens(size, (focal, focal), (cx, cy), (*radial, 0.0, 0.0, 0.0, 0.0, 0.0)[:5])
            found[image.name] = PosedPhoto(image.name, lens, world_from_camera, originals.get(image.name, ""))
    return tuple(found[name] for name in originals if name in found)


def _extract(database: Path, folder: Path, upright: Sequence[UprightPhoto]) -> None:
    """Find the features of all photos. Photos of one size and focal length share a camera.

    The photos are numbered before, in their order: extraction, on all cores, would number them as it ends, and solutions differ with the numbers.
    """
    library = pycolmap()
    library.Database.open(database).close()  # creates it
    options = library.FeatureExtractionOptions()
    options.max_image_size, options.use_gpu = LARGEST_SIDE, False
    options.sift.max_num_features, options.sift.peak_threshold = FEATURES, CONTRAST
    for photo in dict.fromkeys((one.size, one.focal_px) for one in upright):
        (height, width), focal_px = photo
        reader = library.ImageReaderOptions()
        reader.default_focal_length_factor = GUESS
        reader.camera_model = "SIMPLE_RADIAL" if len(upright) >= DISTORTED else "SIMPLE_PINHOLE"
        if focal_px is not None:
            reader.camera_params = f"{focal_px},{width / 2},{height / 2}" + (",0" if len(upright) >= DISTORTED else "")
        names = [one.name for one in upright if (one.size, one.focal_px) == photo]
        mode = library.CameraMode.SINGLE
        library.import_images(database, folder, mode, names, reader)
        library.extract_features(database, folder, names, mode, reader, options, library.Device.cpu)


def _match(database: Path, ordered: bool, longer: int) -> None:
    """Match pairs of photos, and keep the matches that fit one motion of the camera."""
    library = pycolmap()
    matching, verifying = library.FeatureMatchingOptions(), library.TwoViewGeometryOptions()
    matching.use_gpu, matching.guided_matching = False, longer <= GUIDED
    verifying.ransac.max_error = max(PIXELS_OFF / 2, PIXELS_OFF * longer / LARGEST_SIDE)
    verifying.ransac.random_seed = SEED
    match = library.match_sequential if ordered else library.match_exhaustive
    match(database, matching, verification_options=verifying, device=library.Device.cpu)


def best(models: Sequence[Any]) -> list[Any]:
    """Of the models with the most photos, those that fit their observations best, within `EQUAL`; the one with the most usual focal length first."""
    photos = max((model.num_reg_images() for model in models), default=0)
    most = [model for model in models if model.num_reg_images() == photos]
    seen = max((model.compute_num_observations() for model in most), default=0)
    large = [model for model in most if model.compute_num_observations() >= SHARE * seen]
    least = min((model.compute_mean_reprojection_error() for model in large), default=0.0)
    equal = [model for model in large if model.compute_mean_reprojection_error() <= EQUAL * least]
    return sorted(equal, key=lambda model: abs(np.log(_ratio(model) / GUESS)))


def _ratio(model: Any) -> float:
    """The focal length of a model's first camera over the longer side."""
    camera = min(model.cameras.values(), key=lambda one: one.camera_id)
    return float(camera.params[0] / max(camera.width, camera.height))


def _start_at(database: Path, ratio: float) -> None:
    """Set the focal lengths that are unknown, over the longer side."""
    with pycolmap().Database.open(database) as opened:
        for camera in opened.read_all_cameras():
            if not camera.has_prior_focal_length:
                camera.params = [ratio * max(camera.width, camera.height), *camera.params[1:]]
                opened.update_camera(camera)


def _models(
    database: Path, folder: Path, work: Path, held: bool, upright: Sequence[UprightPhoto], first_px: float = FIRST_PX[0]
) -> list[Any]:
    """The models that can be used; none if no camera could be estimated."""
    library, count = pycolmap(), len(upright)
    limits = {photo.name: focal_limits(photo) for photo in upright}
    least = min(count, 3)
    options = library.IncrementalPipelineOptions()
    options.min_model_size, options.random_seed = least, SEED
    options.mapper.random_seed = options.triangulation.random_seed = SEED
    options.max_runtime_seconds = 60 + 10 * count
    options.num_threads = options.mapper.num_threads = 1  # with more, about one solution in a hundred differs
    for part in (options, options.mapper, options.triangulation):
        part.min_focal_length_ratio = min(low for low, _ in limits.values())
        part.max_focal_length_ratio = max(high for _, high in limits.values())
    mapper, triangulation = options.mapper, options.triangulation
    mapper.init_max_error = first_px
    mapper.init_min_num_inliers, mapper.init_min_tri_angle, mapper.abs_pose_min_num_inliers = 50, 4.0, 15
    triangulation.ignore_two_view_tracks = False
    if held:
        options.ba_refine_focal_length = mapper.abs_pose_refine_focal_length = False
    models = list(library.incremental_mapping(database, folder, work, options).values())
    if count > 2 and max((model.num_reg_images() for model in models), default=0) < count:
        at_once = library.GlobalPipelineOptions()
        at_once.min_model_size = least
        for seeded in (at_once, at_once.mapper, at_once.mapper.rotation_averaging, at_once.mapper.global_positioning):
            seeded.random_seed = SEED
        at_once.num_threads = at_once.mapper.num_threads = 1
        at_once.mapper.bundle_adjustment.ceres.solver_options.num_threads = 1
        at_once.mapper.bundle_adjustment.refine_focal_length = not held
        models += library.global_mapping(database, folder, work, at_once).values()
    return [
        model
        for model in models
        if model.num_reg_images() >= least and model.num_points3D() >= LEAST_POINTS and _plausible(model, limits)
    ]


def focal_limits(photo: UprightPhoto) -> tuple[float, float]:
    """The smallest and the largest focal length that a photo may have, over the longer side."""
    known = GUESS if photo.focal_px is None else photo.focal_px / max(photo.size)
    return min(PLAUSIBLE[0], known / NEAR_KNOWN), max(PLAUSIBLE[1], known * NEAR_KNOWN)


def _plausible(model: Any, limits: Mapping[str, tuple[float, float]]) -> bool:
    """Whether all focal lengths are those of usual lenses, or near those that are known."""
    for image in model.images.values():
        camera, (low, high) = model.cameras[image.camera_id], limits[image.name]
        if image.has_pose and not low <= camera.params[0] / max(camera.width, camera.height) <= high:
            return False
    return True


def _shows_motion(model: Any, upright: Sequence[UprightPhoto]) -> bool:
    """Whether the matches of two photos determine how the camera moved, and none but a motion explains them; of more photos, True."""
    if len(upright) != 2:
        return True
    matches, (first, second) = matches_of(model), (model.images[number] for number in sorted(model.images))
    focal, side = model.cameras[first.camera_id].params[0], max(upright[0].size)
    if upright[0].focal_px is None and parallax_px(matches, focal) < TURNED * side:
        return False
    second_from_first = np.eye(4)
    second_from_first[:3] = (second.cam_from_world() * first.cam_from_world().inverse()).matrix()
    return direction_error_deg(matches, focal, second_from_first) <= MOST_DEG


def _median_angle_deg(model: Any) -> float:
    """The median over the points of the widest angle at which the rays of two photos meet [degrees]."""
    centres = {number: image.projection_center() for number, image in model.images.items() if image.has_pose}
    angles = []
    for point in model.points3D.values():
        rays = np.array([centres[element.image_id] - point.xyz for element in point.track.elements])
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        angles.append(np.degrees(np.arccos(np.clip(rays @ rays.T, -1, 1).min())))
    return float(np.median(angles)) if angles else 0.0


def _solution(
    equal: Sequence[Any],
    photos: PhotoSet,
    upright: Sequence[UprightPhoto],
    held: bool,
    focal_given: bool,
    groups: Mapping[str, tuple] | None,
) -> Solution:
    """The first of some models as ours, with notes.

    Raises:
        InputError: the distortion of a lens cannot be undone over the whole image.
    """
    model = equal[0]
    try:
        posed = posed_photos(model, upright)
    except ValueError as error:
        # A lens as wide as those of action cameras, with a distortion that one number does not describe.
        raise InputError(
            photos.path, "photos of a lens whose distortion is that of usual ones", f"solved, {error}",
            advice="take them with a narrower or linear field of view, or undistort them first and give --focal",
        ) from error  # fmt: skip
    missing = [photo.name for photo in upright if photo.name not in {one.name for one in posed}]
    points = list(model.points3D.values())
    placed = SOME_PLACED if missing else ALL_PLACED
    notes: list[str] = [*photos.notes, placed(placed=len(posed), count=len(upright))]
    if missing:
        notes.append(NOT_PLACED(names=listed(missing)))
    ratios = [_ratio(one) for one in equal]
    sure = held or max(ratios) <= UNSURE * min(ratios)
    if groups is not None and len({groups[photo.name] for photo in posed}) > 1:
        notes.append(describe_groups(posed, groups))
    else:
        notes.append(_focal_note(posed, upright, held, focal_given) if sure else _unsure_note(posed[0].lens, ratios))
    return Solution(
        posed,
        np.array([point.xyz for point in points]).reshape(-1, 3),
        np.array([point.color for point in points], dtype=np.uint8).reshape(-1, 3),
        model,
        notes=tuple(notes),
    )


def _focal_note(posed: Sequence[PosedPhoto], upright: Sequence[UprightPhoto], held: bool, focal_given: bool) -> Note:
    """Where the focal length is from."""
    text = _described(posed[0].lens)
    if focal_given:
        return FOCAL_LENGTH(focal=f"{text}, as given")
    known = all(photo.focal_px is not None for photo in upright)
    if held and known:
        return FOCAL_LENGTH(focal=f"{text}, from EXIF")
    if held:
        return GUESSED_OF_TWO(focal=text)
    if not known and len(posed) < DISTORTED:
        return SOLVED_OF_FEW(focal=text)
    return SOLVED(focal=text, start=" from the one in EXIF" if known else "")


def _unsure_note(lens: Lens, ratios: Sequence[float]) -> Note:
    """Which focal lengths fit equally well."""
    low, high = (ratio * max(lens.size) for ratio in (min(ratios), max(ratios)))
    return GUESSED(focal=_described(lens), low=low, high=high)


def _described(lens: Lens) -> str:
    """A focal length as a phrase."""
    degrees = 2 * np.degrees(np.arctan(lens.size[1] / 2 / lens.focal[0]))
    return f"{lens.focal[0]:.0f} px for {lens.size[1]}x{lens.size[0]}, {degrees:.0f} degrees across"
