"""A network as a method to evaluate."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import torch
from jaxtyping import UInt8
from torch import Tensor

from semgs.data.scene import Scene
from semgs.data.tables.classes import ClassTable
from semgs.depth_maps.depth_source import DepthMaps
from semgs.depth_maps.map_depth import find_reference, place_at_maps, read_maps
from semgs.depth_maps.measured_floor import with_measured_floor
from semgs.depth_maps.sensor_depth import place_gaussians
from semgs.evaluation.frames.free_space import score_free_space
from semgs.evaluation.frames.predictions import Inputs, Prediction
from semgs.export.scene_objects import things_of
from semgs.files.errors import InputError
from semgs.model.encode import Network, encode
from semgs.rendering.render import render
from semgs.rendering.rendering import SEEN_ALPHA, confidence_maps, likeliest
from semgs.robotics.objects import STUFF
from semgs.runtime.stopwatch import now
from semgs.scene.encoding import Encoding
from semgs.scene.exposure import ExposureChoice, common_exposure
from semgs.scene.overlap import NearestViews
from semgs.scene.photo_refinement import refine_until
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import up_of
from semgs.segmenters.labelling import Labelling


@dataclass(frozen=True)
class Handling:
    """What is done with a network's Gaussians, and what is made of them.

    Attributes:
        labelling: gives the Gaussians of a scene their classes; None for those of the network.
        nearest: render each target with the Gaussians of only so many input views, those nearest to it; None for all.
        passes: refine the Gaussians with so many steps for each input view; 0 for none.
        depth: gives depth maps of the frames of a scene, which are aligned to the network's depth and weighed with it; None for none.
        sensor: place the Gaussians at the measured depth of the input views instead, which then must have one.
        exposure: whether the input views, and with them the Gaussians, come to a common exposure; targets stay as taken.
        things: find things, as `semgs.objects`; scenes are in metres.
        free_space: map free space and score it, in scenes in metres with measured depth.
        classes: answer in this table, of which each class of the Gaussians is in one; None for that of the Gaussians.
    """

    labelling: Callable[[Scene], Labelling] | None = None
    nearest: NearestViews | None = None
    passes: int = 0
    depth: Callable[[Scene], DepthMaps] | None = None
    sensor: bool = False
    exposure: ExposureChoice = "as-taken"
    things: bool = False
    free_space: bool = False
    classes: ClassTable | None = None


AS_THEY_ARE = Handling()
"""Gaussians are rendered as the network makes them."""


class NetworkMethod:
    """A network as a method: encodes the contexts, renders the target.

    Args:
        network: in evaluation mode.
        device: to encode on.
        name: to call it by in tables.
        handling: what is done with its Gaussians.
    """

    def __init__(self, network: Network, device: str, name: str, handling: Handling = AS_THEY_ARE) -> None:
        self._network = network
        self._device = device
        self.name = name
        self._handling = handling
        self._labelling = None if handling.labelling is None else lru_cache(maxsize=1)(handling.labelling)
        self._depth = None if handling.depth is None else lru_cache(maxsize=1)(handling.depth)

    @torch.no_grad()
    def predict(self, inputs: Inputs) -> Prediction:
        """Encode, refine if requested, then render. Encoding with refining, and rendering, are timed without reading files.

        Raises:
            NotEnoughMemoryError: it would not fit into memory.
        """
        if isinstance(self._network, torch.nn.Module):
            self._network.to(self._device)
        encoded = encode(self._network, inputs.contexts, device=None)  # the GPU back-end renders where the result is
        encoding = encoded.encoding
        if self._handling.sensor:
            encoding = _measured(encoding, inputs)
        elif self._depth is not None:
            encoding = self._place(encoding, inputs, self._depth(inputs.task.scene))
        if self._labelling is not None:
            task = inputs.task
            labelling = self._labelling(task.scene)
            encoding = labelling(encoding, task.scene, task.sample.contexts, inputs.contexts, task.fit)
        if self._handling.sensor and inputs.measured is not None:
            encoding = with_measured_floor(encoding, inputs.measured, metric=inputs.task.scene.unit == "metric")
        if self._handling.classes is not None and encoding.classes not in (None, self._handling.classes):
            encoding = encoding.regrouped(self._handling.classes)
        contexts, exposures = inputs.contexts, common_exposure(inputs.contexts, encoding, self._handling.exposure)
        if exposures is not None:
            contexts, encoding = exposures.applied(contexts), exposures.recoloured(encoding)
        if not self._handling.passes:
            return self._render(encoding, inputs, encoded.seconds)
        one_pass, start = self._render(encoding, inputs, encoded.seconds), now()
        encoding = refine_until(
            encoding, contexts, self._handling.passes, moves=self._depth is None and not self._handling.sensor
        ).encoding
        return replace(self._render(encoding, inputs, encoded.seconds + now() - start), one_pass=one_pass)

    def _place(self, encoding: Encoding, inputs: Inputs, maps: DepthMaps) -> Encoding:
        """The Gaussians at the network's depth and that of maps. The true depth of the input views is no reference."""
        scene, positions, views = inputs.task.scene, inputs.task.sample.contexts, inputs.contexts
        found = read_maps(maps, scene, positions, views.size, inputs.task.fit)
        reference = find_reference(encoding, scene, positions, views, independent=False)
        return place_at_maps(encoding, views, found, maps, reference)[0]

    def _render(self, encoding: Encoding, inputs: Inputs, seconds_encode: float) -> Prediction:
        """The target, rendered."""
        start = now()
        if self._handling.nearest is not None:
            encoding = self._handling.nearest(encoding, inputs.contexts.cameras, inputs.camera)
        rendering = encoding.render(inputs.camera)
        seconds = now() - start
        classes = None if rendering.semantics is None else likeliest(rendering.semantics[0]).cpu()
        found = self._find(encoding, inputs, classes) if self._handling.things and classes is not None else {}
        if self._handling.free_space and inputs.measured is not None:
            found["free_space"] = score_free_space(encoding, inputs.contexts, inputs.measured)
        return Prediction(
            labels=classes,
            image=rendering.images[0].float().clamp(0, 1).cpu(),
            depths=rendering.depths[0].float().cpu(),
            unseen=rendering.alphas[0].cpu() < SEEN_ALPHA,
            seconds_encode=seconds_encode,
            seconds_render=seconds,
            confidences=None if classes is None else torch.from_numpy(confidence_maps(rendering)[0]),
            **found,
        )

    def _find(self, encoding: Encoding, inputs: Inputs, labels: UInt8[Tensor, "h w"]) -> dict[str, Any]:
        """The things of the scene, and where the target shows them: the likeliest thing of each pixel whose class may be a thing's."""
        scene = SavedScene.of(encoding, inputs.contexts.to("cpu"), unit="metric")
        found = things_of(scene, up_of(scene))
        shape = encoding.gaussians.semantic
        assert shape is not None
        chosen = torch.nn.functional.one_hot(torch.from_numpy(found.instances), len(found.things) + 1).to(
            shape.features
        )
        things = replace(encoding.gaussians, semantic=replace(shape, features=chosen))
        rendering = render(things, inputs.camera, near=encoding.depth_range[..., 0].amin(-1, keepdim=True))
        assert rendering.semantics is not None
        numbers = rendering.semantics[0].max(0).indices.int().cpu()
        assert scene.classes is not None
        stuff = torch.tensor([name in STUFF for name in scene.classes.names])
        return {
            "instances": torch.where(stuff[labels.long()], 0, numbers),
            "boxes": tuple((thing.label, thing.box) for thing in found.things),
            "level_from_world": found.level_from_world,
        }

    def __getstate__(self) -> dict[str, object]:
        """How it is sent to a worker process: the network as bytes.

        If sent as tensors, each of its hundreds of tensors would need an open file, and a new process accepts only 256.
        """
        return vars(self) | {"_network": pickle.dumps(self._network)}

    def __setstate__(self, state: dict[str, object]) -> None:
        vars(self).update(state)
        held = state["_network"]
        assert isinstance(held, bytes)
        self._network = pickle.loads(held)


def _measured(encoding: Encoding, inputs: Inputs) -> Encoding:
    """The Gaussians at the measured depth of the input views.

    Raises:
        InputError: nothing was measured in one of them.
    """
    scene, views = inputs.task.scene, inputs.measured
    if views is None or views.depths is None or not (views.depths > 0).flatten(1).any(1).all():
        raise InputError(scene.path, "measured depth in each input view for --depth sensor", "none in one of them")
    return place_gaussians(encoding, views, "sensor", metric=scene.unit == "metric")[0]
