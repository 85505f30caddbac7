"""A reconstruction as a recording of Rerun (https://rerun.io, extra `rerun`), on a timeline of frames.

    world/camera              the camera of each input and held-out frame
    world/camera/photo        its photo; .../classes: its class map, as in renders/
    world/splats/NUMBER       Gaussians that belong to an input frame, which appear at that frame; world/labels/NUMBER: their middles in the colours of their classes
    world/path                the input cameras, joined by lines
    world/things              boxes of the things
    world/floor               the free floor

Positions are in the coordinates of the scene's Gaussians, relative to its origin. The colour of a Gaussian is what its own input view sees: one RGB,
without harmonics.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch

from semgs.data.tables.classes import ClassTable
from semgs.export.scene_objects import occupancy_of, place_things, things_of
from semgs.figures.class_images import UNKNOWN_GREY
from semgs.figures.view_images import as_bytes
from semgs.files.folders import staged
from semgs.geometry.rotations import quaternion_from_matrix
from semgs.rendering.rendering import UNKNOWN, UNSEEN, class_numbers
from semgs.robotics.objects import Objects
from semgs.robotics.occupancy import Occupancy
from semgs.run.output.rerun_library import rerun_library
from semgs.run.steps.result import Reconstruction, RenderedViews
from semgs.scene.own_views import own_colours
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import UpDirection

TIMELINE = "frame"
"""Positions of frames in the source."""

JPEG_QUALITY = 85

UNSEEN_GREY = (60, 60, 60)
"""Colour of pixels that no Gaussian covers."""


def save_rerun(path: Path, result: Reconstruction) -> list[str]:
    """Write a recording of Rerun, without a window or a server.

    Args:
        path: the file, ending in .rrd.
        result: the reconstruction.

    Returns:
        Notes about what could not be found, a sentence each.

    Raises:
        ImportError: rerun-sdk is not installed.
        OSError: the file cannot be written.
    """
    rr = rerun_library()
    with staged(path) as partial:
        with rr.RecordingStream("semgs", send_properties=False) as recording:
            recording.set_log_time_enabled(False)
            recording.set_log_tick_enabled(False)
            recording.save(partial, default_blueprint=_blueprint(rr.blueprint, result.saved))
            notes = _write(rr, recording, result)
            recording.flush()
            recording.disconnect()
        partial.replace(path)
    return notes


def _write(rr: Any, recording: Any, result: Reconstruction) -> list[str]:
    """Log everything."""
    scene, up = result.saved, result.up
    recording.log("world", _up_axis(rr, up), static=True)
    if scene.classes is not None:
        recording.log("world", rr.AnnotationContext(_legend(rr, scene.classes)), static=True)
    for part in result.rendered_views:
        _write_views(rr, recording, part)
    _write_splats(rr, recording, result.context.positions, scene)
    recording.log("world/path", rr.LineStrips3D([result.context.views.cameras.centres.numpy()]), static=True)
    return _write_found(rr, recording, scene, up)


def _write_views(rr: Any, recording: Any, part: RenderedViews) -> None:
    """Log cameras, photos and class maps."""
    cameras = part.views.cameras
    height, width = cameras.size
    for view, position in enumerate(part.positions):
        recording.set_time(TIMELINE, sequence=position)
        pose = cameras.world_from_camera[view].numpy()
        recording.log("world/camera", rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        lens = rr.Pinhole(
            image_from_camera=cameras.intrinsics[view].numpy(), resolution=[width, height], camera_xyz=rr.ViewCoordinates.RDF
        )  # fmt: skip
        recording.log("world/camera", lens)
        photo = rr.Image(as_bytes(part.views.images[view])).compress(jpeg_quality=JPEG_QUALITY)
        recording.log("world/camera/photo", photo)
        if part.labels is not None:
            recording.log("world/camera/classes", rr.SegmentationImage(part.labels[view]))


def _write_splats(rr: Any, recording: Any, positions: tuple[int, ...], scene: SavedScene) -> None:
    """Log the Gaussians of each input view at its frame."""
    gaussians, owners = scene.gaussians.with_footprints(), scene.own_views
    colours = torch.cat((own_colours(scene), gaussians.opacities[:, None]), -1)
    rgba = (255 * colours).round().to(torch.uint8)
    quaternions = gaussians.colour.quaternions.roll(-1, -1)  # (x, y, z, w)
    for view, position in enumerate(positions):
        recording.set_time(TIMELINE, sequence=position)
        own = owners == view
        means = gaussians.means[own].numpy()
        splats = rr.GaussianSplats3D(
            means, scales=gaussians.colour.scales[own].numpy(), quaternions=quaternions[own].numpy(), colors=rgba[own].numpy()
        )  # fmt: skip
        recording.log(f"world/splats/{position}", splats)
        if gaussians.semantic is not None:
            labels = class_numbers(gaussians.semantic.features[own]).to(torch.uint8).numpy()
            recording.log(f"world/labels/{position}", rr.Points3D(means, class_ids=labels))


def _write_found(rr: Any, recording: Any, scene: SavedScene, up: UpDirection) -> list[str]:
    """Log things and free floor at all times; notes about what could not be found."""
    notes = []
    try:
        recording.log("world/things", _boxes(rr, things_of(scene, up)), static=True)
    except (ValueError, ImportError) as error:
        notes.append(f"The Rerun file has no boxes: {error}.")
    try:
        recording.log("world/floor", _grid(rr, occupancy_of(scene, up)), static=True)
    except ValueError as error:
        notes.append(f"The Rerun file has no free floor: {error}.")
    return notes


def _boxes(rr: Any, found: Objects) -> Any:
    """Boxes with class, number and confidence."""
    things = place_things(found)
    return rr.Boxes3D(
        centers=[one.centre for one in things],
        half_sizes=[np.array(one.thing.box.size) / 2 for one in things],
        quaternions=[np.roll(one.quaternion, -1) for one in things],
        class_ids=[one.thing.label for one in things],
        labels=[f"{one.thing.name} {one.thing.instance} ({one.thing.confidence:.0%})" for one in things],
    )


def _grid(rr: Any, found: Occupancy) -> Any:
    """The plan, in RViz's colours; the first row of Rerun's image has the largest y."""
    height, width = found.cells.shape
    frame_from_level = found.level_from_world.T
    w, x, y, z = quaternion_from_matrix(torch.from_numpy(frame_from_level.copy())).tolist()
    return rr.GridMap(
        data=found.cells[::-1].tobytes(),
        format=rr.components.ImageFormat(width=width, height=height, color_model="L", channel_datatype="U8"),
        cell_size=found.resolution,
        translation=frame_from_level @ np.array([*found.origin[:2], found.floor]),
        quaternion=[x, y, z, w],
        colormap=rr.components.Colormap.RvizMap,
    )


def _legend(rr: Any, classes: ClassTable) -> list[Any]:
    """Names and colours of classes, and of unseen and unknown pixels."""
    named = enumerate(zip(classes.names, classes.colours, strict=True))
    return [
        *(rr.AnnotationInfo(number, name, colour) for number, (name, colour) in named),
        rr.AnnotationInfo(UNSEEN, "unseen", UNSEEN_GREY),
        rr.AnnotationInfo(UNKNOWN, "unknown", UNKNOWN_GREY),
    ]


def _up_axis(rr: Any, up: UpDirection) -> Any:
    """The axis nearest to up, about which Rerun's camera turns."""
    axis = int(up.direction.abs().argmax())
    way = "UP" if up.direction[axis] > 0 else "DOWN"
    return getattr(rr.ViewCoordinates, f"RIGHT_HAND_{'XYZ'[axis]}_{way}")


def _blueprint(rrb: Any, scene: SavedScene) -> Any:
    """The layout of Rerun's window: the scene in its colours and by class, and the photo with its class map."""
    inside = [] if scene.classes is None else ["- world/camera/classes"]
    colours = rrb.Spatial3DView(name="scene", origin="world", contents=["+ $origin/**", "- world/labels/**", *inside])
    photo = rrb.Spatial2DView(name="photo", origin="world/camera", contents=["world/camera/photo"])
    if scene.classes is None:
        return rrb.Blueprint(rrb.Horizontal(colours, photo, column_shares=[3, 1]))
    classes = rrb.Spatial3DView(name="classes", origin="world", contents=["+ $origin/**", "- world/splats/**", *inside])
    maps = rrb.Spatial2DView(name="class map", origin="world/camera", contents=["world/camera/classes"])
    return rrb.Blueprint(rrb.Horizontal(rrb.Tabs(colours, classes), rrb.Vertical(photo, maps), column_shares=[3, 1]))
