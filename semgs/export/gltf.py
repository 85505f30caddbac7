"""Binary glTF (.glb) files of Gaussians, with the extension KHR_gaussian_splatting.

One mesh of one primitive of points; every attribute is a float32 array of its own, except for COLOR_0. From the specification of the extension
(https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_gaussian_splatting):

    POSITION                                       with its bounds; glTF has y up
    KHR_gaussian_splatting:ROTATION                unit quaternions (x, y, z, w)
    KHR_gaussian_splatting:SCALE                   standard deviations, linear, not negative
    KHR_gaussian_splatting:OPACITY                 0..1
    KHR_gaussian_splatting:SH_DEGREE_d_COEF_n      harmonics (red, green, blue), in our basis; n counts the orders from -d, every degree complete
    COLOR_0                                        the constant colour and opacity in bytes, for viewers without the extension: they show points

Ours are _CLASS, the position of the likeliest class in the table or 255 for none, and _CONFIDENCE. glTF aligns attributes to four bytes, so a float takes no more
space than a smaller integer. The `extras` of the mesh contain the unit and the classes with their names and colours. If things were searched, _INSTANCE is the number
of the thing, 0 for none, and each thing is a node of its own with the edges of its box as lines, and `extras`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Int64
from torch import Tensor

from semgs._version import __version__
from semgs.export.scene_objects import PlacedThing
from semgs.files.gltf_container import INDICES, VERTICES, GlbBuffer, write_glb
from semgs.geometry.harmonics import DEGREE_0
from semgs.rendering.rendering import class_numbers
from semgs.robotics.boxes import EDGES, SIGNS
from semgs.scene.confidence import class_confidences
from semgs.scene.scene_file import SavedScene
from semgs.splats.gltf_splat import FOOTPRINT

EXTENSION = "KHR_gaussian_splatting"

_POINTS, _LINES = 0, 1
_THINNEST = 1e-4  # a node whose scale is 0 has no inverse [m]


def save_gltf(
    path: str | Path,
    scene: SavedScene,
    keep: Bool[Tensor, " g"] | None = None,
    boxes: Sequence[PlacedThing] = (),
    instances: Int64[np.ndarray, " g"] | None = None,
) -> None:
    """Write the colour Gaussians with their classes as a binary glTF file, in their order.

    Args:
        path: the file, *.glb.
        scene: upright, with y up, as `semgs.scene.upright.upright(scene, "y").scene`.
        keep: the Gaussians to write; all by default.
        boxes: things in the same frame, each written as a node with the edges of its box.
        instances: the number of the thing that each Gaussian belongs to, for the attribute _INSTANCE.

    Raises:
        ValueError: there are no Gaussians to write; glTF cannot express that.
        OSError: the file cannot be written.
    """
    every = _attributes(scene)
    if instances is not None:
        every["_INSTANCE"] = instances[:, None].astype("<f4")
    attributes = {name: values if keep is None else values[keep.numpy()] for name, values in every.items()}
    if not len(attributes["POSITION"]):
        raise ValueError("there are no Gaussians to write; a glTF file needs at least one")
    buffer = GlbBuffer()
    primitive = {
        "mode": _POINTS,
        "attributes": {
            name: buffer.add(values, VERTICES, bounds=name == "POSITION") for name, values in attributes.items()
        },
        "extensions": {EXTENSION: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}},
    }
    content = {
        "asset": {"version": "2.0", "generator": f"SemGS {__version__}"},
        "extensionsUsed": [EXTENSION],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive], "extras": extras(scene)}],
        **buffer.content(),
    }
    if boxes:
        _add_boxes(content, buffer, boxes, scene)
    write_glb(path, content, buffer)


def _add_boxes(content: dict[str, Any], buffer: GlbBuffer, boxes: Sequence[PlacedThing], scene: SavedScene) -> None:
    """Add a node for each box to the content of a file, and to its buffer the unit cube, which all boxes share."""
    position = buffer.add((SIGNS / 2).astype("<f4"), VERTICES, bounds=True)
    index = buffer.add(np.array(EDGES, "<u2").reshape(-1), INDICES)
    labels = sorted({one.thing.label for one in boxes})
    meshes = {label: len(content["meshes"]) + number for number, label in enumerate(labels)}
    content["materials"] = []
    for number, label in enumerate(labels):
        colour = (0, 0, 0) if scene.classes is None else scene.classes.colours[label]
        linear = [round((side / 255) ** 2.2, 4) for side in colour]
        content["materials"].append(
            {"pbrMetallicRoughness": {"baseColorFactor": [*linear, 1.0], "metallicFactor": 0.0}}
        )
        primitive = {"mode": _LINES, "attributes": {"POSITION": position}, "indices": index, "material": number}
        content["meshes"].append({"primitives": [primitive]})
    for box in boxes:
        w, x, y, z = box.quaternion
        thing = box.thing
        node = {
            "name": f"{thing.name} {thing.instance}",
            "mesh": meshes[thing.label],
            "translation": box.centre.tolist(),
            "rotation": [x, y, z, w],
            "scale": [max(side, _THINNEST) for side in thing.box.size],
        }
        about = {"instance": thing.instance, "class": thing.name, "confidence": thing.confidence}
        content["nodes"].append(node | {"extras": about | {"distance": thing.distance}})
    content["scenes"][0]["nodes"] = list(range(len(content["nodes"])))
    content.update(buffer.content())


def _attributes(scene: SavedScene) -> dict[str, np.ndarray]:
    """The attributes of the primitive, [g n] each, rows of whole words of four bytes."""
    gaussians, harmonics = scene.gaussians.with_footprints(), scene.gaussians.colour.features
    constant = (0.5 + DEGREE_0 * harmonics[:, 0]).clamp(0, 1)
    quaternions = torch.nn.functional.normalize(gaussians.colour.quaternions.double(), dim=-1)
    found = {
        "POSITION": gaussians.means,
        "COLOR_0": (torch.cat((constant, gaussians.opacities[:, None]), dim=1) * 255).round().to(torch.uint8),
        f"{EXTENSION}:ROTATION": quaternions.roll(-1, dims=-1),
        f"{EXTENSION}:SCALE": gaussians.colour.scales,
        f"{EXTENSION}:OPACITY": gaussians.opacities[:, None],
    }
    for index in range(harmonics.shape[1]):
        degree = int(index**0.5)
        found[f"{EXTENSION}:SH_DEGREE_{degree}_COEF_{index - degree**2}"] = harmonics[:, index]
    if gaussians.semantic is not None:
        found["_CLASS"] = class_numbers(gaussians.semantic.features)[:, None]
    found["_CONFIDENCE"] = class_confidences(scene)[:, None]
    if scene.gaussians.footprints is not None:  # what reading takes away again
        found[FOOTPRINT] = scene.gaussians.footprints[:, None]
    return {
        name: tensor.detach().cpu().numpy().astype("u1" if name == "COLOR_0" else "<f4")
        for name, tensor in found.items()
    }


def extras(scene: SavedScene) -> dict[str, Any]:
    """What applications may read beside the attributes."""
    found: dict[str, Any] = {"unit": scene.unit}
    if scene.classes is not None:
        names = zip(scene.classes.names, scene.classes.colours, strict=True)
        found["classes"] = [{"name": name, "colour": list(colour)} for name, colour in names]
    return found
