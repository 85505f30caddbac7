"""A network as an ONNX file: one graph of standard operators, for a fixed number of views of a fixed size."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from typing import Any

import torch

from semgs._version import __version__
from semgs.data.views import Views
from semgs.files.errors import needs_extra
from semgs.geometry.cameras import Cameras
from semgs.model.layers.network_input import MULTIPLE, WHOLE
from semgs.model.memory.stage_memory import Stage
from semgs.model.onnx.tensor_form import INPUTS, TensorForm, arguments
from semgs.model.semgs import SemGS
from semgs.sources.runtimes import simplified

OPSET = 20
"""Version of ONNX's operators."""

CONVENTIONS = (
    "images: RGB, 0..1, [view 3 row column]. world_from_camera: camera to world, OpenCV axes (x right, y down, z forward), rigid. intrinsics: pixels; the corner "
    "of the first pixel is (0, 0), its centre (0.5, 0.5). depth_range: near and far of each view. Lengths: metres, or one unit for all. Gaussians: in the order view, row, column; "
    "quaternions (w, x, y, z); scales: standard deviations; colour.features: harmonics in the 3DGS basis; semantic.features: class distribution. depths: z-depth, 0..far; "
    "depth_spread: standard deviation of log depth."
)
"""What the numbers mean, for the file's metadata."""


def check_onnx_libraries() -> None:
    """Check that what makes ONNX files is installed.

    Raises:
        ImportError: the extra `onnx` is missing.
    """
    with needs_extra("onnx", "writing an ONNX file needs onnx, onnxscript and onnxruntime", "onnx"):
        import onnx  # noqa: F401
        import onnxscript  # noqa: F401

        if find_spec("onnxruntime") is None:
            raise ImportError("onnxruntime")


def check_fixed_size(size: tuple[int, int]) -> None:
    """Check a size of images for an ONNX file, which pads none.

    Args:
        size: (height, width) [px].

    Raises:
        ValueError: a side is not a multiple of 16.
    """
    if any(side % MULTIPLE for side in size):
        near = "x".join(str(max(round(side / MULTIPLE), 1) * MULTIPLE) for side in size)
        raise ValueError(
            f"the size is {size[0]}x{size[1]}; expected multiples of {MULTIPLE}, such as {near}: resize images and intrinsics"
        )


def onnx_bytes(
    network: SemGS,
    views: int,
    size: tuple[int, int],
    metadata: Mapping[str, str] | None = None,
    *,
    stage: Stage = nullcontext,
) -> bytes:
    """The content of an ONNX file with the network from `TensorForm`'s inputs to its arrays.

    Args:
        network: in evaluation mode, on the CPU, with a `precision` of float32.
        views: number of input views, 2 or more.
        size: (height, width) of the images, multiples of 16 [px].
        metadata: more entries for the file's metadata.
        stage: context manager around each stage, which has a title.

    Raises:
        ValueError: the size cannot be used.
        ImportError: the extra `onnx` is missing.
    """
    check_fixed_size(size)
    check_onnx_libraries()
    example = _example(views, size)
    inputs, form = arguments(example), TensorForm(network)
    with stage("Tracing the network"), torch.no_grad(), _quiet():
        names = [
            name for name in network(example, WHOLE).gaussians.tensors() if name != "footprints"
        ]  # this also fills caches, which tracing must not do
        traced = torch.export.export(form, inputs, strict=False)
    names += ["depths", "confidences", "depth_spread"]
    with stage("Translating it to ONNX"), torch.no_grad(), _quiet():
        program = torch.onnx.export(
            traced, inputs, dynamo=True, opset_version=OPSET, optimize=False, verbose=False, input_names=INPUTS, output_names=names
        )  # fmt: skip
        assert program is not None
        content: bytes = program.model_proto.SerializeToString()
    with stage("Simplifying the graph"):  # in a tenth of the time of PyTorch's own optimizer
        return _finished(simplified(content), _metadata(network, views, size) | dict(metadata or {}))


def _example(views: int, size: tuple[int, int]) -> Views:
    """Grey views side by side; only their shapes matter."""
    height, width = size
    poses = torch.eye(4, dtype=torch.float64).repeat(views, 1, 1)
    poses[:, 0, 3] = 0.2 * torch.arange(views)
    intrinsics = torch.tensor([[width, 0, width / 2], [0, width, height / 2], [0, 0, 1]], dtype=torch.float64)
    cameras = Cameras(poses, intrinsics.repeat(views, 1, 1), size)
    bounds = torch.tensor([0.5, 10.0], dtype=torch.float64).repeat(views, 1)
    return Views(torch.full((views, 3, height, width), 0.5), cameras, bounds)


@contextmanager
def _quiet() -> Iterator[None]:
    """Hide what PyTorch's exporter reports about its own work."""
    before = logging.root.manager.disable
    logging.disable(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)


def _finished(content: bytes, metadata: Mapping[str, str]) -> bytes:
    """The file with its metadata, checked, and without the sets of operators that it does not use."""
    import onnx

    model = onnx.load_model_from_string(content)
    del model.opset_import[:]
    model.opset_import.append(onnx.helper.make_opsetid("", OPSET))
    model.producer_name, model.producer_version = "semgs", __version__
    onnx.helper.set_model_props(model, dict(metadata))
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


def _metadata(network: SemGS, views: int, size: tuple[int, int]) -> dict[str, str]:
    """What a program needs to know about the file."""
    table = network.classes
    known: dict[str, Any] = {
        "network": network.name,
        "version": __version__,
        "views": str(views),
        "size": f"{size[0]}x{size[1]}",
        "stride": str(network.stride),
        "conventions": CONVENTIONS,
        "origin": network.origin,
    }
    if table is not None:
        known |= {"class_table": table.name, "classes": json.dumps(table.names), "colours": json.dumps(table.colours)}
    if network.temperatures is not None:
        known["temperatures"] = json.dumps(vars(network.temperatures))
    return known
