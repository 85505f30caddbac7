"""Occupancy: where a robot can drive, what it would hit, and what was not seen.

Rays go from the cameras of the input views to the points that they see. A voxel that rays pass through is free, one that they end in is occupied, and all others are
unknown. Heights are above the floor. A cell of the plan is

- occupied if one of its voxels between the step height and the robot's height is;
- free if it is not occupied and the floor is seen in it, or a ray passes through it below the step height;
- unknown otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
import torch
from jaxtyping import Bool, Float, Float64, Int8, Int64, UInt8
from scipy.ndimage import binary_closing
from torch import Tensor

from semgs.data.tables.classes import IGNORE, SCANNET20, ClassTable
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.render import render
from semgs.rendering.rendering import SEEN_ALPHA, class_numbers
from semgs.robotics.floor import FLOOR, NoFloorError, floor_height, level_from_world
from semgs.scene.encoding import per_gaussian

UNKNOWN, FREE, OCCUPIED = -1, 0, 100
"""What cells and voxels contain, as in ROS's nav_msgs/OccupancyGrid."""

UNEVEN = 0.3
"""Points with the class of the floor are on it up to this height, as depth from images is not exact; higher ones have the wrong class [m]."""

ROBOT = 0.5
"""Width of the lane in which an obstacle ahead counts [m]."""

ROUNDING = 1e-9
"""Lengths this close to a whole number of cells are that number: 0.14 / 0.02 is slightly more than 7 in floating point [cells]."""

MOST_VOXELS = 400_000_000
"""More would not fit into the memory of a small machine."""

TOGETHER = 8192
"""Rays that are followed at once."""

SPREADS = 1.0
"""Rays stop this many standard deviations before their end."""


@dataclass(frozen=True)
class Occupancy:
    """Free, occupied and unknown space of a scene, in its level frame.

    Attributes:
        cells: the plan: UNKNOWN, FREE or OCCUPIED.
        voxels: the same in space, from below the floor to the robot's height.
        labels: the class of occupied voxels; 255 for others, and without classes.
        origin: the corner of the first voxel, x, y and z [m].
        resolution: side of cells and voxels [m].
        floor: height of the floor [m].
        level_from_world: from the frame of the Gaussians to the level frame, a rotation.
    """

    cells: Int8[np.ndarray, "y x"]
    voxels: Int8[np.ndarray, "z y x"]
    labels: UInt8[np.ndarray, "z y x"]
    origin: tuple[float, float, float]
    resolution: float
    floor: float
    level_from_world: Float64[np.ndarray, "3 3"]

    @property
    def middles(self) -> Float64[np.ndarray, "y x 2"]:
        """The middle of each cell of the plan, x and y in the level frame [m]."""
        rows, columns = np.indices(self.cells.shape)
        return np.stack((columns + 0.5, rows + 0.5), -1) * self.resolution + self.origin[:2]

    def at(self, places: Float64[np.ndarray, "*any 2"]) -> Int8[np.ndarray, "*any"]:
        """The cells at some places (x, y) of the level frame [m]; UNKNOWN outside of the plan."""
        column, row = np.moveaxis(np.floor((places - self.origin[:2]) / self.resolution).astype(int), -1, 0)
        inside = (row >= 0) & (row < self.cells.shape[0]) & (column >= 0) & (column < self.cells.shape[1])
        return np.where(inside, self.cells[np.where(inside, row, 0), np.where(inside, column, 0)], UNKNOWN).astype(
            np.int8
        )

    def ahead(self, camera: Float64[np.ndarray, "4 4"], width: float = ROBOT, reach: float = 5.0) -> float:
        """The distance to the nearest occupied cell in the lane before a camera, along where it looks; `reach` if there is none [m].

        Args:
            camera: its pose in the frame of the Gaussians.
            width: of the lane [m].
            reach: how far to look [m].
        """
        level = self.level_from_world @ camera[:3]
        forward = level[:2, 2] / max(float(np.linalg.norm(level[:2, 2])), ROUNDING)
        offsets = self.middles[self.cells == OCCUPIED] - level[:2, 3]
        along, across = offsets @ forward, offsets @ (-forward[1], forward[0])
        lane = along[(along > 0) & (np.abs(across) <= width / 2)]
        return min(float(lane.min(initial=reach)), reach)


@dataclass(frozen=True)
class SightRays:
    """What the cameras of the input views saw, in the level frame.

    Attributes:
        origins: where each ray starts [m].
        ends: where it stops [m].
        spread: standard deviation of the logarithm of its length.
    """

    origins: Float64[np.ndarray, "r 3"]
    ends: Float64[np.ndarray, "r 3"]
    spread: Float64[np.ndarray, " r"]


@dataclass(frozen=True)
class MapSettings:
    """What a map is like.

    Attributes:
        resolution: side of cells and voxels [m].
        step: what is lower above the floor is no obstacle [m].
        height: of the robot; what is higher is no obstacle [m].
        reach: of the rays; what is further from its camera is not used [m].
        narrowest: gaps between obstacles that are not wider than this are unknown instead of free, because points on a surface can be as far apart [m].
        min_opacity: Gaussians that are more transparent are not used.
    """

    resolution: float = 0.05
    step: float = 0.1
    height: float = 1.5
    reach: float = 5.0
    narrowest: float = 0.2
    min_opacity: float = 0.1

    def __post_init__(self) -> None:
        positive = 0 < self.step < self.height < inf and 0 < self.resolution < inf and self.reach > 0
        if not (positive and 0 <= self.narrowest < inf):
            raise ValueError(
                f"step is {self.step}, height {self.height}, resolution {self.resolution}, reach {self.reach} and narrowest {self.narrowest}; "
                "expected 0 < step < height, positive others, and narrowest 0 or more"
            )


def occupancy(
    gaussians: Gaussians,
    cameras: Cameras,
    *,
    up: Sequence[float] = (0.0, 0.0, 1.0),
    up_is_known: bool = False,
    classes: ClassTable | None = SCANNET20,
    depths: Float[Tensor, "v h w"] | None = None,
    depth_spread: Float[Tensor, "v h w"] | None = None,
    stride: int = 0,
    **settings: float,
) -> Occupancy:
    """Find free, occupied and unknown space.

    Args:
        gaussians: of one scene in metres.
        cameras: of the input views [v].
        up: the direction that is up.
        up_is_known: whether the user said which way is up; more Gaussians may then be below the floor.
        classes: the table of the Gaussians' classes, whose "floor" is the floor; None uses no classes.
        depths: z-depth of every pixel of the input views, 0 = unknown [m]. Used only without `stride`; None renders them.
        depth_spread: standard deviation of the logarithm of depth of every pixel. Rays stop this much earlier, so that an uncertain depth frees less.
        stride: pixels along each side of the block that a Gaussian stands for, if every block of the input views has one, as in a scene with `places` None;
            rays then end at the Gaussians. 0 if not.
        settings: those of `MapSettings` by name: resolution, step, height, reach, narrowest, min_opacity.

    Raises:
        NoFloorError: no floor was found.
        ValueError: an argument is out of range.
    """
    Gaussians.check_type(gaussians)
    Cameras.check_type(cameras)
    chosen = MapSettings(**settings)
    resolution, reach = chosen.resolution, chosen.reach
    if len(cameras.batch) != 1:
        raise ValueError(
            f"the cameras have leading axes {tuple(cameras.batch)}; expected those of the input views, [v]"
        )
    level = level_from_world(up)
    points = gaussians.means.detach().cpu().double().numpy() @ level.T
    weights = gaussians.opacities.detach().cpu().double().numpy()
    labels = _labels(gaussians, classes)
    on_floor = (
        None if classes is None or FLOOR not in classes.names or labels is None else labels == classes.index(FLOOR)
    )
    rays = rays_of(gaussians, cameras, level, depths, depth_spread, stride)
    if not len(rays.origins):
        raise NoFloorError("no clear floor (the depth of every pixel of the input views is unknown)")
    floor = floor_height(points[:, 2], weights, rays.origins[:, 2], on_floor, up_is_known=up_is_known)
    near = _near(points, cameras, level, reach) & (weights >= chosen.min_opacity)
    points, weights = points[near], weights[near]
    labels, on_floor = (None if one is None else one[near] for one in (labels, on_floor))

    below, above = (int(np.ceil(length / resolution - ROUNDING)) for length in (chosen.step, chosen.height))
    layers = below + above
    plan = np.concatenate((points[:, :2], rays.origins[:, :2]))
    low = np.floor(plan.min(0) / resolution) - 1
    across, along = (np.floor(plan.max(0) / resolution) - low + 2).astype(int).tolist()
    shape = (across, along, layers)
    if np.prod(shape, dtype=float) > MOST_VOXELS:
        raise ValueError(
            f"a grid of {across} x {along} x {layers} voxels; expected at most {MOST_VOXELS:,}: use a larger resolution"
        )
    origin = np.array([*(low * resolution), floor - below * resolution])
    freed = passes(*free_parts(rays, reach, origin, resolution), shape)
    inside, hits = _hits(points, origin, resolution, shape)
    if on_floor is not None:
        on_floor &= np.abs(points[:, 2] - floor) <= UNEVEN
    obstacle = np.ones(len(points), bool) if on_floor is None else ~on_floor
    hit = np.bincount(hits[obstacle[inside]], weights[inside][obstacle[inside]], minlength=freed.size).reshape(shape)
    occupied = (hit >= FEWEST_HITS) & (hit >= HIT_SHARE * freed)
    free = (freed > 0) & ~occupied
    band = slice(2 * below, None)
    seen_floor = np.abs(points[:, 2] - floor) <= chosen.step if on_floor is None else on_floor
    shown = np.bincount(hits[seen_floor[inside]], minlength=freed.size).reshape(shape) > 0
    blocked = np.asarray(occupied[:, :, band].any(-1))
    clear = (free[:, :, : 2 * below] | shown[:, :, : 2 * below]).any(-1) & ~closed(
        blocked, chosen.narrowest / resolution
    )
    cells = np.select([blocked, clear], [OCCUPIED, FREE], UNKNOWN).astype(np.int8)
    voxels = np.select([occupied, free], [OCCUPIED, FREE], UNKNOWN).astype(np.int8)
    named = _named(hits, weights[inside], None if labels is None else labels[inside], occupied)
    return Occupancy(
        cells=cells.T,
        voxels=voxels.transpose(2, 1, 0),
        labels=named.transpose(2, 1, 0),
        origin=(float(origin[0]), float(origin[1]), float(origin[2])),
        resolution=resolution,
        floor=floor,
        level_from_world=level,
    )


FEWEST_HITS = 0.5
"""An occupied voxel has at least this sum of opacities."""

HIT_SHARE = 0.05
"""An occupied voxel has at least this sum of opacities for each ray that passes through it."""


def closed(blocked: Bool[np.ndarray, "x y"], width: float) -> Bool[np.ndarray, "x y"]:
    """The blocked cells and the gaps between them into which no disc of this diameter fits (a morphological closing).

    Args:
        blocked: the plan.
        width: diameter of the disc [cells].
    """
    radius = width / 2 + ROUNDING
    reach = int(radius)
    offsets = np.arange(-reach, reach + 1)
    disc = np.hypot(offsets[:, None], offsets) <= radius
    return binary_closing(np.pad(blocked, reach), disc)[reach or None : -reach or None, reach or None : -reach or None]


def rays_of(
    gaussians: Gaussians,
    cameras: Cameras,
    level: Float64[np.ndarray, "3 3"],
    depths: Float[Tensor, "v h w"] | None,
    depth_spread: Float[Tensor, "v h w"] | None,
    stride: int = 0,
) -> SightRays:
    """From each camera to its own Gaussians, or, without a stride, to the points at the given or rendered depths."""
    (views,) = cameras.batch
    spread = torch.zeros(views, *cameras.size) if depth_spread is None else depth_spread
    if not stride:
        if depths is None:
            depths = _rendered_depths(gaussians, cameras)
        ends = back_project(depths.double(), cameras)
        known = depths > 0
        origins = cameras.centres[:, None, None].expand(ends.shape)[known]
        ends, spread = ends[known], spread[known]
    else:
        ends, spread = gaussians.means.detach().double(), per_gaussian(spread[:, None], stride)[:, 0]
        if len(ends) != len(spread):
            raise ValueError(
                f"there are {len(ends)} Gaussians for {len(spread)} blocks of {stride}x{stride} pixels; "
                "expected one for each, or no stride"
            )
        origins = cameras.centres.repeat_interleave(len(ends) // views, 0)
    found = (one.cpu().double().numpy() for one in (origins, ends))
    origins, ends = (one @ level.T for one in found)
    return SightRays(origins, ends, spread.cpu().double().numpy())


def _rendered_depths(gaussians: Gaussians, cameras: Cameras) -> Float[Tensor, "v h w"]:
    """The depth that each camera sees, 0 where it sees little."""
    with torch.no_grad():
        views = [render(gaussians, cameras[index : index + 1]) for index in range(cameras.batch[0])]
    return torch.cat([torch.where(view.alphas >= SEEN_ALPHA, view.depths, 0) for view in views])


def free_parts(
    rays: SightRays, reach: float, origin: Float64[np.ndarray, " 3"], resolution: float
) -> tuple[Float64[np.ndarray, "r 3"], Float64[np.ndarray, "r 3"]]:
    """Both ends of the parts of rays that are free, in voxels: up to `reach`, and to a voxel before their end or to where their depth is uncertain."""
    along = rays.ends - rays.origins
    lengths = np.linalg.norm(along, axis=-1)
    free = np.minimum(lengths * np.exp(-SPREADS * rays.spread), lengths - resolution).clip(0, reach)
    stops = rays.origins + along * (free / lengths.clip(min=1e-9))[:, None]
    return (rays.origins - origin) / resolution, (stops - origin) / resolution


def passes(
    origins: Float64[np.ndarray, "r 3"], ends: Float64[np.ndarray, "r 3"], shape: tuple[int, int, int]
) -> Int64[np.ndarray, "x y z"]:
    """How many rays pass through each voxel, the voxels of both ends included.

    All rays of a block take one step at a time into the neighbour behind the side that they leave through (Amanatides and Woo, "A fast voxel traversal algorithm for ray
    tracing", Eurographics 1987).

    Args:
        origins, ends: in units of voxels from the corner of the grid; parts outside of the grid are left out.
        shape: of the grid.
    """
    counts = np.zeros(int(np.prod(shape)), np.int64)
    for start in range(0, len(origins), TOGETHER):
        block = slice(start, start + TOGETHER)
        counts += np.bincount(_visited(origins[block], ends[block], shape), minlength=len(counts))
    return counts.reshape(shape)


def _visited(
    origins: Float64[np.ndarray, "r 3"], ends: Float64[np.ndarray, "r 3"], shape: tuple[int, int, int]
) -> Int64[np.ndarray, " n"]:
    """The voxels on each ray, one after the other, as positions in the flat grid."""
    along = ends - origins
    with np.errstate(divide="ignore", invalid="ignore"):
        sides = np.stack((-origins, np.array(shape) - origins)) / along
    # Along an axis on which a ray stands still it is always inside, or never.
    still = np.where((origins >= 0) & (origins < shape), np.inf, -np.inf)
    enters = np.where(along == 0, -still, sides.min(0)).max(1).clip(min=0)
    leaves = np.where(along == 0, still, sides.max(0)).min(1).clip(max=1)
    inside = enters < leaves
    origins, along, enters, leaves = (array[inside] for array in (origins, along, enters, leaves))
    cells = np.floor(origins + enters[:, None] * along).astype(np.int64).clip(0, np.array(shape) - 1)
    steps = np.sign(along).astype(np.int64)
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    found = []
    while len(cells):
        found.append(cells @ strides)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossings = np.where(along == 0, np.inf, (cells + (steps > 0) - origins) / along)
        axis = crossings.argmin(1)
        rows = np.arange(len(cells))
        cells[rows, axis] += steps[rows, axis]
        going = (crossings[rows, axis] < leaves) & (cells >= 0).all(1) & (cells < shape).all(1)
        cells, steps, origins, along, leaves = (array[going] for array in (cells, steps, origins, along, leaves))
    return np.concatenate(found) if found else np.zeros(0, np.int64)


def _labels(gaussians: Gaussians, classes: ClassTable | None) -> Int64[np.ndarray, " g"] | None:
    """The likeliest class of each Gaussian, 255 for none."""
    if gaussians.semantic is None or classes is None:
        return None
    found = gaussians.semantic.features.shape[-1]
    if found != len(classes):
        raise ValueError(f"the Gaussians have {found} classes; expected the {len(classes)} of table {classes.name}")
    return class_numbers(gaussians.semantic.features).cpu().numpy()


def _near(
    points: Float64[np.ndarray, "n 3"], cameras: Cameras, level: Float64[np.ndarray, "3 3"], reach: float
) -> Bool[np.ndarray, " n"]:
    """Whether points are within reach of a camera."""
    near = np.zeros(len(points), bool)
    for eye in cameras.centres.numpy() @ level.T:
        near |= np.linalg.norm(points - eye, axis=-1) <= reach
    return near


def _hits(
    points: Float64[np.ndarray, "n 3"],
    origin: Float64[np.ndarray, " 3"],
    resolution: float,
    shape: tuple[int, int, int],
) -> tuple[Int64[np.ndarray, " i"], Int64[np.ndarray, " i"]]:
    """The points inside of the grid, and the voxel of each as a position in the flat grid."""
    places = np.floor((points - origin) / resolution).astype(np.int64)
    inside = np.flatnonzero(((places >= 0) & (places < shape)).all(-1))
    return inside, np.ravel_multi_index(tuple(places[inside].T), shape)


def _named(
    hits: Int64[np.ndarray, " i"],
    weights: Float64[np.ndarray, " i"],
    labels: Int64[np.ndarray, " i"] | None,
    occupied: Bool[np.ndarray, "x y z"],
) -> UInt8[np.ndarray, "x y z"]:
    """The class with the largest sum of opacities in each occupied voxel."""
    flat = np.full(occupied.size, IGNORE, np.uint8)
    if labels is not None and (labels != IGNORE).any():
        hits, labels, weights = (one[labels != IGNORE] for one in (hits, labels, weights))
        pairs, owners = np.unique(np.stack((hits, labels)), axis=1, return_inverse=True)
        order = np.argsort(np.bincount(owners.reshape(-1), weights), kind="stable")
        flat[pairs[0][order]] = pairs[1][order]  # the last, with the largest sum, stays
    return np.where(occupied, flat.reshape(occupied.shape), IGNORE).astype(np.uint8)
