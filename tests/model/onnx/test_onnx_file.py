"""ONNX files: their operators, names and metadata, and that ONNX Runtime gives what PyTorch gives."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace

import pytest
import torch
from float32_cameras import float32_cameras
from golden import fill_golden
from networks import preset
from posed import posed_views
from torch import nn

from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.plane_sweep import depth_candidates, expected_depth
from semgs.model.attention.camera_attention import normalised_projections
from semgs.model.gaussians.placing import Rays, points
from semgs.model.layers.network_input import WHOLE, NetworkInput
from semgs.model.onnx.onnx_file import check_fixed_size, onnx_bytes
from semgs.model.onnx.tensor_form import INPUTS, arguments
from semgs.model.settings import OURS
from semgs.model.sweep.cost_volume import cost_volume
from semgs.rendering.temperatures import Temperatures
from semgs.scene.encoding import Encoding

onnx = pytest.importorskip("onnx", minversion="1.20", reason="the extra onnx is not installed")
pytest.importorskip("onnxscript", reason="the extra onnx is not installed")
onnxruntime = pytest.importorskip("onnxruntime", reason="the extra onnx is not installed")

SIZE = (32, 48)
CLASSES = ClassTable("two", ("wall", "shower curtain"), ((1, 2, 3), (4, 5, 6)), (1, 28))


class TinyNetwork(nn.Module):
    """One convolution and a plane sweep of 20 planes: each pixel's Gaussian lies at the expected depth, and its size is its distance from cameras."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = nn.Conv2d(3, 8, 3, padding=1)
        self.name, self.stride, self.classes, self.origin = "tiny", 1, CLASSES, "drawn by hand"
        self.temperatures = Temperatures(1.5, 2.0)

    def forward(self, views: Views, chunks: object) -> Encoding:
        inputs = NetworkInput.of(views, self.conv.weight, 1)
        features, candidates = self.conv(inputs.images)[None], depth_candidates(inputs.depth_range, 20)
        cost = cost_volume(features, inputs.cameras, inputs.depth_range[..., 0], candidates)[0]
        probabilities = cost.softmax(1)
        depths = expected_depth(probabilities, candidates[0].to(cost))
        rays = Rays.of(inputs.cameras.flatten(), cost)
        means = points(depths, None, rays, OURS).flatten(0, 2)
        projection, _ = normalised_projections(inputs.cameras, inputs.near)
        scales = means.square() + projection.to(means).square().mean()
        quaternions = rays.quaternion.repeat_interleave(depths[0].numel(), 0)
        colours = inputs.images.movedim(1, -1).flatten(0, 2)[:, None]
        shares = features[0].movedim(1, -1)[..., :2]
        semantic = Appearance(-quaternions, 2 * scales, shares.flatten(0, 2).softmax(-1))
        gaussians = Gaussians(means, means[:, 0].sigmoid(), Appearance(quaternions, scales, colours), semantic)
        return Encoding(gaussians, depths, probabilities.amax(1), depths.log(), inputs.depth_range[0])


@pytest.fixture(scope="module")
def unchecked() -> Iterator[None]:
    with float32_cameras():
        yield


@pytest.fixture(scope="module")
def tiny(unchecked: None) -> tuple[TinyNetwork, bytes]:
    torch.manual_seed(0)
    network = TinyNetwork().eval().requires_grad_(False)
    return network, onnx_bytes(network, 2, SIZE, {"data_terms": "none"})


def differences(content: bytes, network: nn.Module, views: Views) -> dict[str, float]:
    """The largest difference of each array between ONNX Runtime and PyTorch."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    session = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    given = {name: tensor.numpy() for name, tensor in zip(INPUTS, arguments(views), strict=True)}
    found = dict(zip([one.name for one in session.get_outputs()], session.run(None, given), strict=True))
    encoding = network(views, WHOLE)
    expected = replace(encoding.gaussians, footprints=None).tensors() | {
        name: getattr(encoding, name) for name in ("depths", "confidences", "depth_spread")
    }
    assert found.keys() == expected.keys()
    return {name: float((torch.from_numpy(found[name]) - expected[name]).abs().max()) for name in found}


def check_differences(found: dict[str, float]) -> None:
    """At most 0.1 mm in positions and depth, and 1e-3 in other arrays."""
    assert max(found["means"], found["depths"]) < 1e-4
    assert max(found.values()) < 1e-3


def test_onnx_runtime_gives_what_pytorch_gives(tiny: tuple[TinyNetwork, bytes]):
    network, content = tiny
    for seed in (0, 1):
        check_differences(differences(content, network, posed_views(2, SIZE, seed)))


def test_a_file_has_standard_operators_in_float32_and_fixed_shapes(tiny: tuple[TinyNetwork, bytes]):
    model = onnx.load_model_from_string(tiny[1])
    assert [(one.domain, one.version) for one in model.opset_import] == [("", 20)]
    assert {node.domain for node in model.graph.node} == {""}
    assert [
        node.op_type for node in model.graph.node if node.op_type in ("SplitToSequence", "SequenceAt", "Loop", "If")
    ] == []
    kinds = {one.data_type for one in model.graph.initializer}
    assert onnx.TensorProto.DOUBLE not in kinds
    assert all(
        attribute.i != onnx.TensorProto.DOUBLE
        for node in model.graph.node
        for attribute in node.attribute
        if node.op_type == "Cast"
    )
    shapes = {
        one.name: tuple(side.dim_value for side in one.type.tensor_type.shape.dim)
        for one in (*model.graph.input, *model.graph.output)
    }
    pixels = 2 * 32 * 48
    assert shapes == {
        "images": (2, 3, 32, 48), "world_from_camera": (2, 4, 4), "intrinsics": (2, 3, 3), "depth_range": (2, 2),
        "means": (pixels, 3), "opacities": (pixels,), "colour.quaternions": (pixels, 4), "colour.scales": (pixels, 3),
        "colour.features": (pixels, 1, 3), "semantic.quaternions": (pixels, 4), "semantic.scales": (pixels, 3),
        "semantic.features": (pixels, 2), "depths": (2, 32, 48), "confidences": (2, 32, 48), "depth_spread": (2, 32, 48),
    }  # fmt: skip


def test_a_file_says_what_it_is(tiny: tuple[TinyNetwork, bytes]):
    model = onnx.load_model_from_string(tiny[1])
    told = {one.key: one.value for one in model.metadata_props}
    assert (told["network"], told["views"], told["size"], told["stride"]) == ("tiny", "2", "32x48", "1")
    assert json.loads(told["classes"]) == ["wall", "shower curtain"]
    assert json.loads(told["colours"]) == [[1, 2, 3], [4, 5, 6]]
    assert json.loads(told["temperatures"]) == {"rendered": 1.5, "gaussians": 2.0}
    assert (told["class_table"], told["data_terms"], told["origin"]) == ("two", "none", "drawn by hand")
    assert "camera to world, OpenCV axes" in told["conventions"]
    assert model.producer_name == "semgs"


@pytest.mark.parametrize(
    ("size", "line"),
    [
        ((240, 330), "the size is 240x330; expected multiples of 16, such as 240x336"),
        ((33, 320), "the size is 33x320; expected multiples of 16, such as 32x320"),
    ],
)
def test_a_size_that_needs_padding_is_refused(size: tuple[int, int], line: str):
    with pytest.raises(ValueError, match=line):
        check_fixed_size(size)
    check_fixed_size((240, 320))


@pytest.mark.long
@pytest.mark.parametrize("views", [2, 3])
def test_a_random_network_of_the_included_kind_agrees(unchecked: None, views: int):
    network = fill_golden(preset("small")).eval().requires_grad_(False)
    check_differences(differences(onnx_bytes(network, views, SIZE), network, posed_views(views, SIZE)))


@pytest.mark.long
def test_a_network_of_the_papers_size_agrees_as_far_as_float32_does(unchecked: None):
    """Its random weights are sharp: PyTorch itself is a millimetre from the exact depth."""
    network = fill_golden(preset("base")).eval().requires_grad_(False)
    found = differences(onnx_bytes(network, 2, SIZE), network, posed_views(2, SIZE))
    assert max(found["means"], found["depths"]) < 1e-2
    assert max(value for name, value in found.items() if name not in ("means", "depths")) < 1e-3
