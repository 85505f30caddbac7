"""From some views of a scene to Gaussians with their depth and classes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.choosing.choice import Choice
from semgs.data.frames import Frame
from semgs.data.resampling import default_size
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.depth_maps.depth_source import DepthMaps, FrameMaps
from semgs.depth_maps.map_depth import MapPlacement, find_reference, fits, place_at_maps, read_maps
from semgs.depth_maps.measured_floor import with_measured_floor
from semgs.depth_maps.sensor_depth import DepthSource, Placement, place_gaussians, read_measured
from semgs.files.errors import InputError
from semgs.files.text import counted
from semgs.mapping.mapper import unusable
from semgs.mapping.windows import encode_in_windows
from semgs.model.classes.view_cache import ViewCache
from semgs.model.encode import Network, encode
from semgs.model.memory.memory_plan import MemoryPlan
from semgs.runtime.cores import adapt_threads
from semgs.runtime.notes import Kind
from semgs.runtime.stopwatch import Stages
from semgs.scene.encoding import Encoding
from semgs.segmenters.class_source import ClassSource
from semgs.segmenters.labelling import Labelling
from semgs.sources.source import cost_of

ENCODING = Kind("Encoding {count} views with {network}", "Building the room from {count} photos")


class ViewEncoder:
    """The steps from some views of a scene to Gaussians with their depth and classes.

    Args:
        scene, network, depth, labelling, stages: as for `reconstruct`.
        size: (height, width) of the frames as read [px].

    Attributes:
        plan: how memory was used, in the first views for which it was short; None for a network that `memory_plan` does not support.
    """

    def __init__(
        self,
        scene: Scene,
        network: Network,
        size: tuple[int, int],
        depth: DepthSource | DepthMaps,
        labelling: Labelling | None,
        stages: Stages,
    ) -> None:
        self._scene, self._network, self._size = scene, network, size
        self._depth, self._labelling, self._stages = depth, labelling, stages
        self._placements: dict[int, Placement | MapPlacement] = {}
        self._segmenter_cost = self._depth_cost = ""
        self._cache = ViewCache()
        self.plan: MemoryPlan | None = None

    def read(self, positions: Sequence[int], depth_range: DepthRange) -> Views:
        """Read input frames.

        Raises:
            InputError: a frame cannot be read, or has no depth map, or the sensor measured too little of it.
        """
        return read_inputs(self._scene, positions, self._size, self._depth, depth_range)

    def read_target(self, choice: Choice) -> Views | None:
        """Read the held-out frames; None if there are none.

        Raises:
            InputError: a frame cannot be read.
        """
        return self._scene.read(choice.targets, self._size, choice.depth_range) if choice.targets else None

    def try_networks(self, positions: Sequence[int]) -> None:
        """Measure what classes and depth maps of frames take to compute, to show it with these stages; before other stages raise the peak of memory."""
        frames = [self._scene.frames[position] for position in positions]
        if self._labelling is not None:
            self._segmenter_cost = self._try(self._labelling.source, frames)
        if not isinstance(self._depth, str):
            self._depth_cost = self._try(self._depth, frames)

    def _try(self, source: ClassSource | DepthMaps, frames: Sequence[Frame]) -> str:
        """What the maps of frames take, to be put behind the title of a stage; "" if nothing is computed."""
        with self._stages("load", f"Trying {source.title}"):
            cost = cost_of(source, frames)
        return "" if cost is None else f": {cost}"

    def encode(
        self,
        positions: Sequence[int],
        views: Views,
        target: Views | None = None,
        windows: Sequence[Sequence[int]] = (),
    ) -> Encoding:
        """Encode views, place the Gaussians at a sensor's depth, and give them the classes of a segmenter, as requested. Measured depth also tells what is floor.

        Args:
            positions: of the frames in the scene.
            views: the frames as read.
            target: views that will be rendered later and also need memory.
            windows: of each view, as for `encode_in_windows`; () encodes all views at once.

        Raises:
            NotEnoughMemoryError: it would not fit in memory.
            ValueError: there are fewer than two views; or as `Labelling`.
        """
        adapt_threads()
        encoding_views = ENCODING(count=len(views), network=self._network.name)
        if windows:
            with self._stages.steps("encode", encoding_views, len(set(map(tuple, windows)))) as done:
                encoding = encode_in_windows(views, windows, self._encode, done)
        else:
            with self._stages("encode", encoding_views):
                encoding = self._encode(views, target)
        if self._depth != "network":
            encoding, placement = self._place(encoding, positions, views, self._depth)
            for position, fit in zip(positions, placement.fits, strict=True):
                self._placements.setdefault(position, replace(placement, fits=(fit,)))  # type: ignore[arg-type]
        if self._labelling is not None:
            title = (
                f"Classes of {counted(len(views), 'photo')} from {self._labelling.source.title}{self._segmenter_cost}"
            )
            with self._stages("segment", title):
                # Merging makes the classes agree.
                labelling = replace(self._labelling, fusion=False) if windows else self._labelling
                encoding = labelling(encoding, self._scene, positions, views)
        if self._depth in ("sensor", "both"):
            encoding = with_measured_floor(encoding, views, metric=self._scene.unit == "metric")
        return encoding

    def _encode(self, views: Views, target: Views | None = None) -> Encoding:
        """The network's Gaussians of some views."""
        encoded = encode(self._network, views, target, cache=self._cache)
        if self.plan is None or not self.plan.short:
            self.plan = encoded.plan
        return replace(encoded.encoding, classes=self._network.classes)

    def _place(
        self, encoding: Encoding, positions: Sequence[int], views: Views, depth: Literal["sensor", "both"] | DepthMaps
    ) -> tuple[Encoding, Placement | MapPlacement]:
        """Place the Gaussians at the depth of a sensor or of maps. Returns them, and how they were placed."""
        count = f"{len(encoding.gaussians):,} Gaussians"
        if isinstance(depth, str):
            with self._stages("place", f"Placing {count} at the measured depth"):
                return place_gaussians(encoding, views, depth, metric=self._scene.unit == "metric")
        with self._stages("depth", f"Depth of {counted(len(views), 'photo')} from {depth.title}{self._depth_cost}"):
            maps = read_maps(depth, self._scene, positions, views.size)
        with self._stages("place", f"Placing {count} with the help of depth maps"):
            reference = find_reference(
                encoding, self._scene, positions, views, independent=not isinstance(depth, FrameMaps)
            )
            # If maps of an earlier window fit, one bad window is no reason to give up a walk.
            trusted = any(isinstance(one, MapPlacement) and fits(one.fits[0]) for one in self._placements.values())
            return place_at_maps(encoding, views, maps, depth, reference, trusted=trusted)

    def placement(self, positions: Sequence[int]) -> Placement | MapPlacement | None:
        """How the Gaussians of frames were placed when these were first encoded; None if their depth is the network's."""
        if not self._placements:
            return None
        fits = tuple(self._placements[position].fits[0] for position in positions)
        return replace(self._placements[positions[0]], fits=fits)  # type: ignore[arg-type]


def read_inputs(
    scene: Scene,
    positions: Sequence[int],
    size: tuple[int, int],
    depth: DepthSource | DepthMaps,
    depth_range: DepthRange,
) -> Views:
    """As `ViewEncoder.read`."""
    if depth in ("sensor", "both"):
        return read_measured(scene, positions, size, depth_range)
    views = scene.read(positions, size, depth_range)
    if isinstance(depth, FrameMaps) and (views.depths is None or not (views.depths > 0).flatten(1).any(1).all()):
        read_maps(depth, scene, positions, size)  # says which frame has none
    return views


def why_not(
    scene: Scene,
    position: int,
    size: Sequence[int] | None,
    depth: DepthSource | DepthMaps,
    depth_range: DepthRange,
) -> str | None:
    """Why a frame cannot be an input view; None if it can.

    Args:
        scene: contains the frame.
        position: of the frame.
        size, depth: as for `reconstruct`.
        depth_range: near and far of the scene.
    """
    height, width = default_size(scene.frames[position].lens.size) if size is None else size
    try:
        view = read_inputs(scene, [position], (height, width), depth, depth_range)
    except InputError as error:
        return str(error)
    return unusable(view)
