"""How well `semgs.objects` and `semgs.occupancy` find things and free floor in generated rooms.

    python scripts/objects_and_floor.py [--seed 2801] [--rooms 12] [--assets DIR] [--pictures OUT]

Generates rooms of a seed at 240x320, encodes four views of each with the included weights, and compares with the solids that the room is made of. Rows are by the
source of depth: the network; what a depth camera would have measured (`scripts/sensor_depth.py`); and the exact depth with the true classes, which shows what the
method itself loses. Up is found by `up_of` for all rows.

- Things: a true thing is what one piece of furniture shows in the views, in one class. PQ is over the Gaussians, and a pair matches above an IoU of 0.5. Boxes are compared
  with the boxes of the true points of the same Gaussians, and match at an IoU of 0.25.
- Floor: a cell is truly occupied if a solid is in it between step height and robot height, and truly free if it is in the room and nothing is. A camera sees a free
  cell if it sees the floor at its middle within 4 m, and a wall's cell if one of its pixels shows the wall there.

With --pictures, writes the grids as PNG: found and true, side by side.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float64, Int64
from sensor_depth import measured
from shared import markdown

from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.data.views import Views
from semgs.depth_maps.sensor_depth import place_gaussians
from semgs.export.scene_objects import occupancy_of, things_of
from semgs.files.images.pictures import write_png
from semgs.geometry.cameras import back_project, project
from semgs.model.weights.load import load
from semgs.robotics.boxes import Box, box_of
from semgs.robotics.floor import NoFloorError
from semgs.robotics.objects import STUFF, Objects
from semgs.robotics.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy
from semgs.rooms.assets.asset_library import Library, open_library
from semgs.rooms.drawing.room import Room, build_room
from semgs.rooms.pieces.solids import BALL, BOX, CUSHION, CYLINDER, SHELL
from semgs.rooms.sets.carried_cameras import draw_camera, draw_habit, draw_path
from semgs.rooms.sets.room_stream import generator, keep_overlap, shoot
from semgs.scene.encoding import Encoding
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import up_of

SIZE, VIEWS, GAP = (240, 320), 4, 2.0
"""Size of the images, number of views, and steps of the camera between them."""

SOURCES = ("network", "sensor", "truth")
STEP, HEIGHT, NEAR = 0.1, 1.5, 4.0
"""Step height and robot height, and how near a camera has to be to a free cell [m]."""

SPACING = 0.02
"""Distance between the points that fill solids [m]."""

CELLS = (
    "free floor", "walls", "occupied called free", "seen occupied called free", "free called occupied", "outside called free",
)  # fmt: skip
"""Columns of the table of the floor: the share of true cells of a kind that are found as another, or as they are."""

OF_THINGS = ("PQ", "recall", "precision", "true", "found", "size, median cm", "centre, median cm")
"""Columns of the table of things."""

FEWEST = 60
"""A true thing shows at least as many Gaussians."""

MATCH_MASKS, MATCH_BOXES = 0.5, 0.25
ABOVE_FLOOR = 0.03
"""Height above the floor at which cells are looked at, above rugs [m]."""


@dataclass(frozen=True)
class Drawn:
    """A room and its input views."""

    room: Room
    views: Views


@dataclass(frozen=True)
class TrueThings:
    """What belongs to which piece.

    Attributes:
        instances: the piece of each Gaussian in one class, from 1; 0 for none.
        labels: the class of each piece, by its number less 1.
        points: the true point of each Gaussian [m].
    """

    instances: Int64[np.ndarray, " g"]
    labels: tuple[int, ...]
    points: Float64[np.ndarray, "g 3"]


@dataclass(frozen=True)
class TrueFloor:
    """The true plan, on the cells that were found.

    Attributes:
        occupied, free: by the solids.
        seen_free: free cells whose floor a camera sees within `NEAR`.
        seen_wall, seen_occupied: cells of walls, and of anything, that a pixel shows.
    """

    occupied: Bool[np.ndarray, "y x"]
    free: Bool[np.ndarray, "y x"]
    seen_free: Bool[np.ndarray, "y x"]
    seen_wall: Bool[np.ndarray, "y x"]
    seen_occupied: Bool[np.ndarray, "y x"]


def draw(seed: int, index: int, library: Library | None) -> Drawn:
    """Room `index` of a seed, and the views of a camera in it."""
    rng = generator(seed, index)
    room = build_room(rng, library)
    habit = draw_habit(rng, "home")
    camera = draw_camera(rng, SIZE, habit)
    span = (VIEWS - 1) / 2
    path = draw_path(rng, room, camera, GAP * (span + 0.5), habit).change_pace(GAP)
    path = keep_overlap(rng, room, path, camera, habit.overlap)
    poses = [path.pose(float(place)) for place in np.arange(VIEWS) - span]
    return Drawn(room, shoot(rng, room, poses, camera))


def scene_of(encoding: Encoding, views: Views, source: str, seed: int) -> SavedScene:
    """The scene with its depth from a source."""
    if source == "sensor":
        encoding = place_gaussians(encoding, replace(views, depths=measured(views, seed)), "sensor")[0]
    if source == "truth":
        assert views.depths is not None
        assert views.labels is not None
        known = torch.where(views.labels == IGNORE, SCANNET20.index("otherfurniture"), views.labels).long()
        maps = torch.nn.functional.one_hot(known, len(SCANNET20)).movedim(-1, 1).float()
        depths = torch.where(views.depths > 0, views.depths, 20.0)
        exact = torch.zeros_like(depths)
        encoding = encoding.with_depths(depths, views.cameras, opacities=exact + 0.6, depth_spread=exact)
        encoding = encoding.with_classes(maps, SCANNET20)
    return SavedScene.of(encoding, views, unit="metric")


def true_things(drawn: Drawn, scene: SavedScene) -> TrueThings:
    """What each Gaussian shows, by a ray through it."""
    room, count = drawn.room, len(scene.gaussians)
    origins = scene.cameras.centres.repeat_interleave(count // VIEWS, 0).numpy()
    directions = scene.gaussians.means.double().numpy() - origins
    triangles, distances = room.caster.cast(origins, directions)
    parts = np.where(triangles < 0, -1, room.owners[triangles])
    piece_of = np.full(len(room.plan.parts) + 1, -1)
    for number, (first, end) in enumerate(room.plan.pieces):
        piece_of[first:end] = number
    labels = np.append(room.solids.labels, IGNORE)[parts]
    stuff = [SCANNET20.index(name) for name in STUFF if name in SCANNET20.names]
    thing = (piece_of[parts] >= 0) & (labels != IGNORE) & ~np.isin(labels, stuff)
    pairs, owners, counts = np.unique(
        np.stack((piece_of[parts][thing], labels[thing])), axis=1, return_inverse=True, return_counts=True
    )
    number = np.where(counts >= FEWEST, np.cumsum(counts >= FEWEST), 0)
    instances = np.zeros(count, np.int64)
    instances[thing] = number[owners.reshape(-1)]
    reached = np.where(np.isfinite(distances), distances, 1.0)[:, None]
    return TrueThings(instances, tuple(pairs[1][counts >= FEWEST].tolist()), origins + reached * directions)


def filled(room: Room) -> tuple[Float64[np.ndarray, "n 3"], Bool[np.ndarray, " n"]]:
    """Points that fill the solids of a room between step height and robot height, and whether each is in a wall."""
    points, in_wall = [np.zeros((0, 3))], [np.zeros(0, bool)]
    solids = room.solids
    for part, shape in enumerate(solids.shapes):
        size, turn, centre = solids.sizes[part], solids.rotations[part], solids.centres[part]
        reach = float(np.abs(turn[2]) @ size) / 2
        if shape == SHELL or centre[2] + reach <= STEP or centre[2] - reach >= HEIGHT:
            continue
        counts = np.maximum(np.ceil(size / SPACING).astype(int), 2)
        axes = [(np.arange(count) + 0.5) / count - 0.5 for count in counts]
        if not solids.rotations[part][2, 1]:  # upright: only the layers that count
            axes[2] = axes[2][(centre[2] + axes[2] * size[2] > STEP) & (centre[2] + axes[2] * size[2] < HEIGHT)]
        unit = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
        inside = {
            BOX: np.ones(len(unit), bool),
            CYLINDER: np.hypot(unit[:, 0], unit[:, 1]) <= 0.5,
            BALL: np.linalg.norm(unit, axis=-1) <= 0.5,
            CUSHION: ((2 * unit) ** 4).sum(-1) <= 1,
        }[int(shape)]
        points.append((unit[inside] * size) @ turn.T + centre)
        in_wall.append(np.full(int(inside.sum()), solids.labels[part] == SCANNET20.index("wall")))
    if len(room.shells.corners):
        scattered = _scattered(room.shells.corners)
        points.append(scattered)
        in_wall.append(np.zeros(len(scattered), bool))
    every, walls = np.concatenate(points), np.concatenate(in_wall)
    band = (every[:, 2] > STEP) & (every[:, 2] < HEIGHT)
    return every[band], walls[band]


def _scattered(corners: Float64[np.ndarray, "t 3 3"]) -> Float64[np.ndarray, "n 3"]:
    """Points on triangles, about `SPACING` apart."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.linalg.norm(np.cross(a, b), axis=-1) / 2
    counts = np.maximum(np.ceil(areas / SPACING**2).astype(int), 1)
    rng = np.random.default_rng(0)
    owners = np.repeat(np.arange(len(corners)), counts)
    u, v = rng.random((2, len(owners)))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return corners[owners, 0] + u[:, None] * a[owners] + v[:, None] * b[owners]


def true_floor(drawn: Drawn, found: Occupancy) -> TrueFloor:
    """The true plan on the cells of an occupancy."""
    room, views = drawn.room, drawn.views
    assert views.depths is not None
    assert views.labels is not None

    def cells(points: Float64[np.ndarray, "n 3"]) -> Bool[np.ndarray, "y x"]:
        """The cells with a point."""
        level = points @ found.level_from_world.T
        places = np.floor((level[:, :2] - found.origin[:2]) / found.resolution).astype(int)
        columns, rows = places[((places >= 0) & (places < found.cells.shape[::-1])).all(-1)].T
        hit = np.zeros(found.cells.shape, bool)
        hit[rows, columns] = True
        return hit

    occupied = cells(filled(room)[0])
    rows, columns = np.indices(found.cells.shape)
    middles = np.stack((columns + 0.5, rows + 0.5), -1).reshape(-1, 2) * found.resolution + found.origin[:2]
    world = np.column_stack((middles, np.full(len(middles), found.floor))) @ found.level_from_world
    inside = room.inside(np.column_stack((world[:, :2], np.full(len(world), 0.5))))
    free = inside.reshape(found.cells.shape) & ~occupied
    on_floor = np.column_stack((world[:, :2], np.full(len(world), ABOVE_FLOOR)))
    seen = np.zeros(len(world), bool)
    pixels = project(torch.from_numpy(on_floor), views.cameras).numpy()
    for eye, (x, y, z) in zip(views.cameras.centres.numpy(), pixels.transpose(0, 2, 1), strict=True):
        height, width = SIZE
        shown = (z > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
        shown &= np.linalg.norm(on_floor[:, :2] - eye[:2], axis=-1) <= NEAR
        origins = np.broadcast_to(eye, on_floor[shown].shape)
        seen[np.flatnonzero(shown)[room.caster.reached(origins, on_floor[shown] - origins, 0.999)]] = True
    points = back_project(views.depths.double(), views.cameras).numpy()
    known = (views.depths > 0).numpy() & (points[..., 2] > STEP) & (points[..., 2] < HEIGHT)
    is_wall = known & (views.labels == SCANNET20.index("wall")).numpy()
    return TrueFloor(occupied, free, free & seen.reshape(free.shape), cells(points[is_wall]), cells(points[known]))


def unseen(room: Room) -> Occupancy:
    """The plan of a room in which no floor was found: all unknown."""
    across, along, _ = room.plan.size
    resolution = 0.05
    shape = (round(along / resolution) + 6, round(across / resolution) + 6)
    return Occupancy(
        cells=np.full(shape, UNKNOWN, np.int8),
        voxels=np.full((1, *shape), UNKNOWN, np.int8),
        labels=np.full((1, *shape), IGNORE, np.uint8),
        origin=(-across / 2 - 3 * resolution, -along / 2 - 3 * resolution, 0.0),
        resolution=resolution,
        floor=0.0,
        level_from_world=np.eye(3),
    )


def box_iou(one: Box, other: Box) -> float:
    """Volume that two upright boxes share, relative to that of both."""
    plans = [box.corners[[0, 1, 3, 2], :2].astype(np.float32) for box in (one, other)]
    area, _ = cv2.intersectConvexConvex(*plans)
    bottom, top = (
        edge(box.centre[2] + sign * box.size[2] / 2 for box in (one, other)) for edge, sign in ((max, -1), (min, 1))
    )
    shared = area * max(top - bottom, 0.0)
    volumes = sum(float(np.prod(box.size)) for box in (one, other))
    return shared / max(volumes - shared, 1e-12)


def padded(box: Box) -> Box:
    """The box, at least 10 cm thick along every axis: for flat things such as pictures and windows, IoU would depend on millimetres."""
    length, width, height = (max(side, 0.1) for side in box.size)
    return Box(box.centre, (length, width, height), box.yaw)


class Scores:
    """Counts of one source of depth, over all rooms."""

    def __init__(self) -> None:
        self.counts: dict[str, float] = defaultdict(float)
        self.sizes: list[float] = []
        self.distances: list[float] = []

    def add_things(self, found: Objects, truth: TrueThings) -> None:
        """Match masks and boxes, each in order of overlap."""
        true_boxes = [
            box_of(truth.points[truth.instances == number] @ found.level_from_world.T)
            for number in range(1, len(truth.labels) + 1)
        ]
        masks, boxes = [], []
        for thing in found.things:
            mine = found.instances == thing.instance
            for number, (label, box) in enumerate(zip(truth.labels, true_boxes, strict=True), 1):
                if label == thing.label:
                    theirs = truth.instances == number
                    masks.append(((mine & theirs).sum() / (mine | theirs).sum(), thing.instance, number))
                    boxes.append((box_iou(padded(thing.box), padded(box)), thing.instance, number))
        by_instance = {thing.instance: thing for thing in found.things}
        for thing in found.things:
            self.counts[f"found {thing.name}"] += 1
        for label in truth.labels:
            self.counts[f"true {SCANNET20.names[label]}"] += 1
        for iou, instance, _ in _matched(masks, MATCH_MASKS):
            self.counts[f"mask {by_instance[instance].name}"] += 1
            self.counts[f"iou {by_instance[instance].name}"] += float(iou)
        for _, instance, number in _matched(boxes, MATCH_BOXES):
            box, true = by_instance[instance].box, true_boxes[number - 1]
            self.counts[f"box {by_instance[instance].name}"] += 1
            self.sizes += [100 * abs(a - b) for a, b in zip(box.size, true.size, strict=True)]
            self.distances.append(float(np.linalg.norm(np.subtract(box.centre, true.centre))) * 100)

    def add_floor(self, found: Occupancy, truth: TrueFloor) -> None:
        """Count the cells of each kind."""
        free, occupied = found.cells == FREE, found.cells == OCCUPIED
        outside = ~truth.free & ~truth.occupied
        for name, hit, of in (
            ("free floor", free, truth.seen_free), ("walls", occupied, truth.seen_wall),
            ("occupied called free", free, truth.occupied), ("seen occupied called free", free, truth.occupied & truth.seen_occupied),
            ("free called occupied", occupied, truth.seen_free), ("outside called free", free, outside),
        ):  # fmt: skip
            self.counts[f"hit {name}"] += float((hit & of).sum())
            self.counts[f"of {name}"] += float(of.sum())

    def share(self, name: str) -> float:
        """Share of cells."""
        return self.counts[f"hit {name}"] / max(self.counts[f"of {name}"], 1)

    def sum(self, kind: str, name: str | None = None) -> float:
        """Sum over all classes, or the number of one."""
        if name is not None:
            return self.counts[f"{kind} {name}"]
        return sum(self.counts[f"{kind} {one}"] for one in SCANNET20.names)

    def panoptic(self, name: str) -> float:
        """PQ of a class: the sum of the IoU of matches over the mean of found and true things."""
        return self.counts[f"iou {name}"] / max((self.sum("found", name) + self.sum("true", name)) / 2, 1e-9)

    def of_things(self) -> list[str]:
        """The numbers of `OF_THINGS`."""
        quality = np.mean([self.panoptic(name) for name in self.classes])
        true, found, boxes = self.sum("true"), self.sum("found"), self.sum("box")
        errors = [f"{np.median(values or [np.nan]):.0f}" for values in (self.sizes, self.distances)]
        shares = [f"{boxes / true:.2f}", f"{boxes / max(found, 1):.2f}", f"{true:.0f}", f"{found:.0f}"]
        return [f"{quality:.3f}", *shares, *errors]

    def of_class(self, name: str) -> str:
        """PQ, recall and precision of a class."""
        true, found, boxes = (self.sum(kind, name) for kind in ("true", "found", "box"))
        return f"{self.panoptic(name):.2f}, {boxes / true:.2f}, {boxes / max(found, 1):.2f}"

    @property
    def classes(self) -> list[str]:
        """The classes that are truly there."""
        return [name for name in SCANNET20.names if self.sum("true", name)]


def _matched(pairs: list[tuple[float, int, int]], least: float) -> list[tuple[float, int, int]]:
    """Pairs one to one, the best first."""
    used: set[tuple[str, int]] = set()
    kept = []
    for overlap, found, true in sorted(pairs, reverse=True):
        if overlap >= least and not {("found", found), ("true", true)} & used:
            used |= {("found", found), ("true", true)}
            kept.append((overlap, found, true))
    return kept


def picture(found: Occupancy, truth: TrueFloor) -> np.ndarray:
    """Found beside true, three pixels a cell: white free, black occupied, grey unknown; in the truth, dark grey is free but unseen."""
    left = np.select([found.cells == FREE, found.cells == OCCUPIED], [254, 0], 160)
    right = np.select(
        [truth.seen_free, truth.free, truth.occupied & truth.seen_occupied, truth.occupied], [254, 200, 0, 70], 160
    )
    both = np.concatenate((left, np.full((len(left), 4), 120), right), 1)[::-1].astype(np.uint8)
    return both.repeat(3, 0).repeat(3, 1)


@torch.no_grad()
def main() -> None:
    """Measure and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=2801)
    parser.add_argument("--rooms", type=int, default=12)
    parser.add_argument("--assets", type=Path, action="append", default=[])
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    library = open_library(arguments.assets) if arguments.assets else None
    network = load("small").eval()
    scores = {source: Scores() for source in SOURCES}
    for index in range(arguments.rooms):
        drawn = draw(arguments.seed, index, library)
        encoding = network(drawn.views)
        up = up_of(scene_of(encoding, drawn.views, "network", index))
        for source, score in scores.items():
            scene = scene_of(encoding, drawn.views, source, index)
            score.add_things(things_of(scene, up), true_things(drawn, scene))
            try:
                found = occupancy_of(scene, up, step=STEP, height=HEIGHT)
            except NoFloorError:
                score.counts["no floor"] += 1
                found = unseen(drawn.room)
            truth = true_floor(drawn, found)
            score.add_floor(found, truth)
            alone = Scores()
            alone.add_floor(found, truth)
            shares = ", ".join(f"{name} {alone.share(name):.1%}" for name in CELLS)
            print(f"room {index}, {source}: floor {found.floor:.2f} m, {shares}", file=sys.stderr, flush=True)
            if arguments.pictures:
                arguments.pictures.mkdir(exist_ok=True)
                write_png(arguments.pictures / f"{index:02d}_{source}.png", picture(found, truth))
    rows = [
        [source, *[f"{score.share(name):.1%}" for name in CELLS], f"{score.counts['no floor']:.0f}"]
        for source, score in scores.items()
    ]
    print(markdown(["depth", *CELLS, "rooms without floor"], rows))
    rows = [[source, *score.of_things()] for source, score in scores.items()]
    print("\n" + markdown(["depth", *OF_THINGS], rows))
    rows = [
        [name, f"{scores['network'].sum('true', name):.0f}", *[score.of_class(name) for score in scores.values()]]
        for name in scores["network"].classes
    ]
    print("\n" + markdown(["class", "true", *[f"{source}: PQ, recall, precision" for source in SOURCES]], rows))


if __name__ == "__main__":
    main()
