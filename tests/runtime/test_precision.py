"""Autocast is for layers: cameras, depth and Gaussians keep float32, on the CPU and on CUDA, and both devices agree."""

from __future__ import annotations

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_cameras, posed_views

from semgs import load, open_scene
from semgs.data.demo_scene import demo_scene
from semgs.data.resampling import resized
from semgs.data.views import Views
from semgs.geometry.cameras import Cameras, project
from semgs.geometry.gaussians import Gaussians
from semgs.geometry.plane_sweep import depth_candidates
from semgs.model.attention.camera_attention import token_transforms
from semgs.model.sweep.cost_volume import cost_volume
from semgs.run.device import chosen_precision
from semgs.runtime.precision import has_bfloat16_units
from semgs.scene.encoding import Encoding

SIZE = (32, 48)


@pytest.fixture(scope="module")
def room() -> Views:
    """Two photos of the embedded room, small."""
    return photos((48, 64))


def photos(size: tuple[int, int]) -> Views:
    return resized(open_scene(demo_scene()).read([1, 3], size=None), size)


def difference(a: torch.Tensor, b: torch.Tensor) -> float:
    """Norm of the difference over the norm."""
    return float((a.cpu().double() - b.cpu().double()).norm() / b.double().norm())


def farthest(a: Encoding, b: Encoding) -> float:
    """The largest difference among depth, opacities, and the means, sizes and features of both branches."""
    return max(difference(a.depths, b.depths), farthest_gaussians(a.gaussians, b.gaussians))


def farthest_gaussians(a: Gaussians, b: Gaussians) -> float:
    """The largest difference among opacities, and the means, sizes and features of both branches."""
    pairs = [(a.opacities, b.opacities), (a.means, b.means)]
    for one, other in ((a.colour, b.colour), (a.semantic, b.semantic)):
        pairs += [(one.scales, other.scales), (one.features, other.features)]
    return max(difference(one, other) for one, other in pairs)


def dtypes(encoding: Encoding) -> set[torch.dtype]:
    found = {encoding.depths.dtype, encoding.confidences.dtype, encoding.depth_spread.dtype}
    encoding.gaussians.map(lambda tensor: found.add(tensor.dtype) or tensor)
    return found


def test_autocast_leaves_cameras_alone(device) -> None:
    one = posed_cameras(3, SIZE)
    cameras = Cameras(one.world_from_camera[None], one.intrinsics[None], SIZE)
    generator = torch.Generator().manual_seed(0)
    tokens = torch.randn(1, 3, 4, 6, 16, generator=generator).to(device)
    features = torch.randn(1, 3, 8, 8, 12, generator=generator).to(device)
    near = torch.full((1, 3), 0.5, dtype=torch.float64)
    candidates = depth_candidates(torch.tensor([0.5, 10.0]).expand(1, 3, 2), 9).to(device)

    def geometry() -> list[torch.Tensor]:
        transforms = token_transforms(cameras, near[:, 0], (4, 6), 16, tokens)
        return [
            transforms.projection,
            transforms.queries(tokens),
            transforms.keys(tokens),
            transforms.outputs(tokens),
            cost_volume(features, cameras, near, candidates, fused=False),
            cost_volume(features, cameras, near, candidates),
        ]

    plain = geometry()
    with torch.autocast(device.type, torch.bfloat16):
        inside = geometry()
    for found, expected in zip(inside, plain, strict=True):
        assert expected.dtype == torch.float32
        assert torch.equal(found, expected)


@pytest.mark.parametrize("name", ["small_plain", pytest.param("base", marks=pytest.mark.long)])
def test_under_autocast_gaussians_are_float32_and_lie_at_their_depth(device, name: str) -> None:
    model = fill_golden(preset(name)).to(device)
    views = posed_views(2, SIZE)
    with torch.no_grad(), torch.autocast(device.type, torch.bfloat16):
        encoding = model(views)
    assert dtypes(encoding) == {torch.float32}
    assert encoding.depths.device.type == device.type
    depths = project(encoding.gaussians.means.cpu().double().reshape(2, -1, 3), views.cameras)[..., 2]
    pixels = encoding.depths[:, :: model.stride, :: model.stride].cpu().double()
    assert ((depths - pixels.flatten(1)) / pixels.flatten(1)).abs().max() < 1e-5


@pytest.mark.parametrize("paper_heads", [False, True])
def test_logits_of_depth_disparity_and_opacity_are_float32_under_autocast(paper_heads: bool) -> None:
    model = fill_golden(preset("small_plain", paper_heads=paper_heads))
    last = [
        "colour.depth.regressor.head.2",
        "colour.heads.opacity.2" if paper_heads else "colour.heads.refinement.to_disparity.2",
    ]
    given = {}
    for name in [*last, "colour.heads.colour.2"]:
        model.get_submodule(name).register_forward_hook(
            lambda layer, inputs, output, name=name: given.__setitem__(name, (inputs[0], output))
        )
    with torch.no_grad(), torch.autocast("cpu", torch.bfloat16):
        model(posed_views(2, SIZE))
    assert {name: output.dtype for name, (_, output) in given.items()} == {
        **dict.fromkeys(last, torch.float32), "colour.heads.colour.2": torch.bfloat16
    }  # fmt: skip
    for name in last:  # not only their type: a layer that rounds its products to eight bits would differ by 1e-3
        layer, (seen, output) = model.get_submodule(name), given[name]
        exact = torch.nn.functional.conv2d(
            seen.double(), layer.weight.detach().double(), layer.bias.detach().double(), padding=layer.padding
        )
        assert difference(output, exact) < 1e-5


def test_trained_weights_bear_bfloat16(device) -> None:
    """Where two surfaces meet, rounding may decide on which of them a Gaussian lies; all others stay where they are. Processors round
    differently: from 0.05 to 0.08 % move at this size (of 48x64, where most pixels are close to an edge, 0.8 to 1.04 %)."""
    model = load("small").eval()
    model.fuses = False
    room = photos((96, 128))
    with torch.no_grad():
        exact = model(room)
        with torch.autocast(device.type, torch.bfloat16):
            rounded = model.to(device)(room)
    moved = ((rounded.depths.cpu() - exact.depths) / exact.depths).abs() > 0.05
    assert moved.float().mean() < 0.002
    stay = ~moved[:, :: model.stride, :: model.stride].flatten()
    kept = [one.gaussians.map(lambda tensor: tensor.cpu()[stay]) for one in (rounded, exact)]
    assert 1e-5 < farthest_gaussians(*kept) < 2e-2


def test_rounding_changes_the_class_of_few_gaussians_on_which_views_agree(device, room) -> None:
    """Where a view is at the limit of having a say, rounding decides."""
    model = load("small").eval()
    assert model.fuses
    with torch.no_grad():
        exact = model(room).gaussians.semantic.features.argmax(-1)
        with torch.autocast(device.type, torch.bfloat16):
            rounded = model.to(device)(room).gaussians.semantic.features.argmax(-1).cpu()
    assert (exact != rounded).float().mean() < 0.02


@pytest.mark.gpu
@pytest.mark.parametrize("views", [2, 3, 4])
@pytest.mark.parametrize("name", ["small_plain", "base"])
def test_the_whole_network_on_cuda_equals_the_cpu(cuda, name: str, views: int) -> None:
    model = fill_golden(preset(name))
    pictures = posed_views(views, SIZE)
    with torch.no_grad():
        here = model(pictures)
        there = model.to(cuda)(pictures)
    assert there.depths.device.type == "cuda"
    assert farthest(there, here) < 1e-4


@pytest.mark.gpu
def test_gradients_on_cuda_equal_the_cpus(cuda) -> None:
    pictures = posed_views(2, SIZE)
    gradients = []
    for device in ("cpu", cuda):
        model = fill_golden(preset("small_plain")).to(device)
        encoding = model(pictures)
        (encoding.depths.log().mean() + encoding.gaussians.colour.features.square().mean()).backward()
        gradients.append([one.grad.cpu() for one in model.parameters() if one.grad is not None])
    for on_cpu, on_cuda in zip(*gradients, strict=True):
        assert difference(on_cuda, on_cpu) < 1e-2 or on_cpu.norm() < 1e-6


@pytest.mark.parametrize(
    ("flags", "expected"),
    [
        ("fpu sse avx2 avx512f avx512_bf16", True),
        ("fpu amx_bf16 amx_tile", True),
        ("fpu avx2 avx512f avx512bw", False),
        ("fpu avx512_bf16x", False),
    ],
)
def test_the_processor_says_whether_it_computes_in_bfloat16(tmp_path, flags: str, expected: bool) -> None:
    (tmp_path / "proc").mkdir()
    (tmp_path / "proc/cpuinfo").write_text(f"processor\t: 0\nbugs\t\t: bf16\nflags\t\t: {flags}\n\nprocessor\t: 1\n")
    assert has_bfloat16_units(tmp_path) == expected


def test_a_processor_that_says_nothing_computes_in_float32(tmp_path) -> None:
    assert not has_bfloat16_units(tmp_path)


@torch.no_grad()
def test_a_network_in_bf16_gives_what_autocast_around_it_gives(room: Views) -> None:
    model = preset("small_plain")
    exact = model(room)
    with torch.autocast("cpu", torch.bfloat16):
        around, alone = model(room), model.classify(room)
    model.precision = "bf16"
    assert farthest(model(room), around) == 0.0
    assert torch.equal(model.classify(room), alone)
    assert farthest(around, exact) > 0.0
    model.precision = "float32"
    assert farthest(model(room), exact) == 0.0


@torch.no_grad()
def test_float32_of_a_network_leaves_an_autocast_around_it_in_force(room: Views) -> None:
    model = preset("small_plain")
    with torch.autocast("cpu", torch.bfloat16):
        inside = model(room)
    assert farthest(inside, model(room)) > 0.0


@pytest.mark.parametrize(
    ("asked", "device", "units", "expected"),
    [
        ("auto", "cpu", True, "bf16"),
        ("auto", "cpu", False, "float32"),
        ("auto", "cuda", True, "float32"),
        ("float32", "cpu", True, "float32"),
        ("bf16", "cpu", False, "bf16"),
        ("bf16", "cuda", False, "bf16"),
    ],
)
def test_auto_is_bf16_only_on_processors_that_compute_in_it(
    asked: str, device: str, units: bool, expected: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    monkeypatch.setattr("semgs.runtime.precision.has_bfloat16_units", lambda: units)
    assert chosen_precision(asked, device) == expected
    slow = (asked, device, units) == ("bf16", "cpu", False)
    assert ("only imitates bf16" in capsys.readouterr().err) == slow
