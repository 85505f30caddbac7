"""Point clouds: a point at the middle of each Gaussian, with colour, class and confidence.

The PLY has float x y z, uchar red green blue, and float scalar_label and scalar_confidence, names that CloudCompare reads as scalar fields without asking.
The `.mcap` is a ROS 2 bag with one sensor_msgs/PointCloud2, x y z, packed rgb, label and confidence, for RViz and Foxglove. If things were searched, both also have
the number of the thing: scalar_instance and instance, 0 for none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64, UInt8
from torch import Tensor

from semgs.data.ply_tables import packed, write_ply
from semgs.files.bags import write_message
from semgs.rendering.rendering import class_numbers
from semgs.scene.confidence import class_confidences
from semgs.scene.own_views import own_colours
from semgs.scene.scene_file import SavedScene

TOPIC, FRAME = "/semgs/points", "map"
"""Where the points are in a bag."""

STAMP = 1_000_000_000
"""Time of the message [ns]: always the same, so that equal scenes give equal files."""


@dataclass(frozen=True)
class Points:
    """Points of a scene.

    Attributes:
        means: positions.
        colours: red, green, blue, as the input view of each point sees it.
        labels: position in the class table, 255 for none; None without classes.
        confidences: 0..1, of the class, or of the depth without classes.
        instances: the number of the thing that each belongs to, 0 for none; None if things were not searched.
    """

    means: Float[Tensor, "n 3"]
    colours: UInt8[Tensor, "n 3"]
    labels: Int64[Tensor, " n"] | None
    confidences: Float[Tensor, " n"]
    instances: Int64[Tensor, " n"] | None = None

    def __len__(self) -> int:
        return len(self.means)

    def only(self, keep: Bool[Tensor, " n"]) -> Points:
        """Some of the points."""
        labels, instances = (None if one is None else one[keep] for one in (self.labels, self.instances))
        return Points(self.means[keep], self.colours[keep], labels, self.confidences[keep], instances)


def make_points(scene: SavedScene, instances: Int64[np.ndarray, " g"] | None = None) -> Points:
    """A point for each Gaussian, in their order.

    Args:
        scene: with all of its Gaussians.
        instances: the number of the thing that each Gaussian belongs to.
    """
    gaussians = scene.gaussians
    return Points(
        means=gaussians.means,
        colours=(255 * own_colours(scene)).round().to(torch.uint8),
        labels=None if gaussians.semantic is None else class_numbers(gaussians.semantic.features),
        confidences=class_confidences(scene),
        instances=None if instances is None else torch.from_numpy(instances),
    )


def save_points(path: str | Path, points: Points) -> None:
    """Write a PLY, binary little endian.

    Raises:
        OSError: it cannot be written.
    """
    colours = dict(zip(("red", "green", "blue"), points.colours.numpy().T, strict=True))
    write_ply(path, _columns(points, colours, prefix="scalar_"))


def save_bag(path: Path, points: Points) -> None:
    """Write a bag with one PointCloud2, in the frame `FRAME`.

    Raises:
        ImportError: rosbags is not installed.
        OSError: it cannot be written.
    """

    def message(types: Mapping[str, Any]) -> Any:
        time = types["builtin_interfaces/msg/Time"](*divmod(STAMP, 10**9))
        return cloud_message(points, types, types["std_msgs/msg/Header"](time, FRAME))

    write_message(path, TOPIC, STAMP, message)


def cloud_message(points: Points, types: Mapping[str, Any], header: Any) -> Any:
    """Points as a PointCloud2 with the fields x, y, z, rgb, label and confidence, and instance if things were searched.

    Args:
        points: to be sent.
        types: the classes of messages, by their names.
        header: of the message.
    """
    red, green, blue = points.colours.numpy().astype("<u4").T
    rgb = (red << 16 | green << 8 | blue).view("<f4")  # the bits 0x00rrggbb, as PCL packs them
    rows = packed(_columns(points, {"rgb": rgb}))
    field = types["sensor_msgs/msg/PointField"]
    return types["sensor_msgs/msg/PointCloud2"](
        header=header,
        height=1,
        width=len(rows),
        fields=[field(name, 4 * place, field.FLOAT32, 1) for place, name in enumerate(rows.dtype.names or ())],
        is_bigendian=False,
        point_step=rows.dtype.itemsize,
        row_step=rows.nbytes,
        data=np.frombuffer(rows.tobytes(), np.uint8),
        is_dense=True,
    )


def _columns(points: Points, colours: dict[str, np.ndarray], prefix: str = "") -> dict[str, np.ndarray]:
    """Position, colour, label, confidence and instance of each point; the last three as far as they are known.

    Args:
        points: the points.
        colours: the columns of their colours.
        prefix: of the names of the last three.
    """
    columns = dict(zip("xyz", points.means.numpy().T, strict=True)) | colours
    for name in ("labels", "confidences", "instances"):
        if (values := getattr(points, name)) is not None:
            columns[prefix + name.removesuffix("s")] = values.numpy()
    return columns
