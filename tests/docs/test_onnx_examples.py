"""The programs in examples/onnx: from photos and a file of cameras to a labelled splat, with ONNX Runtime alone."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from semgs import load, load_splat, open_scene
from semgs.data.demo_scene import demo_scene
from semgs.data.tables.classes import SCANNET20
from semgs.data.views import Views
from semgs.figures.view_images import as_bytes

onnx = pytest.importorskip("onnx", minversion="1.20", reason="the extra onnx is not installed")
pytest.importorskip("onnxruntime", reason="the extra onnx is not installed")

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples" / "onnx"
RUNTIME = "ONNXRUNTIME_DIR"
"""Environment variable: a folder with `include` and `lib` of ONNX Runtime's releases."""

CAMERAS = ((5, 6, 3.5, 2.5, 0.5, 8, *range(12)), (7, 8, 2.5, 1.5, 0.25, 4, *range(20, 32)))
"""fx fy cx cy near far and the pose of two views."""


def write_cameras(folder: Path) -> Path:
    """Two photos of 4x6 pixels and their cameras."""
    for k in range(2):
        pixels = (np.arange(72).reshape(4, 6, 3) + 100 * k).astype(np.uint8)
        Image.fromarray(pixels).save(folder / f"{k}.ppm")
    lines = (" ".join(map(str, (f"{k}.ppm", *numbers))) for k, numbers in enumerate(CAMERAS))
    path = folder / "cameras.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


def write_network(path: Path) -> None:
    """A graph of 18 Gaussians that shows what it was given: the same as onnxruntime_stub's."""
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    inputs = {"images": (2, 3, 4, 6), "world_from_camera": (2, 4, 4), "intrinsics": (2, 3, 3), "depth_range": (2, 2)}
    g = np.arange(18)
    constants = {
        "opacities": (g + 1) / 20, "colour.scales": g[:, None] + np.arange(3) + 1, "colour.quaternions": np.eye(4)[g % 4],
        "semantic.features": np.eye(2)[g % 2],
    }  # fmt: skip
    shapes = {"means": (18, 3), "colour.features": (18, 1, 3)} | {name: made.shape for name, made in constants.items()}
    whole = {
        "flat": [-1],
        "first": [0],
        "last": [54],
        **{f"shape of {name}": shapes[name] for name in ("means", "colour.features")},
    }
    nodes = [helper.make_node("Reshape", [name, "flat"], [f"{name} flat"]) for name in inputs]
    nodes += [
        helper.make_node("Concat", [f"{name} flat" for name in list(inputs)[1:]], ["numbers"], axis=0),
        helper.make_node("Reshape", ["numbers", "shape of means"], ["means"]),
        helper.make_node("Slice", ["images flat", "first", "last"], ["begin"]),
        helper.make_node("Reshape", ["begin", "shape of colour.features"], ["colour.features"]),
        *(helper.make_node("Identity", [f"made {name}"], [name]) for name in constants),
    ]
    initial = [onnx.numpy_helper.from_array(np.asarray(one, np.int64), name) for name, one in whole.items()]
    initial += [onnx.numpy_helper.from_array(one.astype(np.float32), f"made {name}") for name, one in constants.items()]
    graph = helper.make_graph(
        nodes, "known", [helper.make_tensor_value_info(name, kind, shape) for name, shape in inputs.items()],
        [helper.make_tensor_value_info(name, kind, shape) for name, shape in shapes.items()], initial,
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=10)
    helper.set_model_props(model, {"size": "4x6", "classes": json.dumps(["wall", "shower curtain"])})
    onnx.save(model, path)


def run(*arguments: str | Path) -> str:
    """What a program prints."""
    done = subprocess.run(list(map(str, arguments)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def check_known_splat(path: Path) -> None:
    """The splat of the network of 18 Gaussians for `CAMERAS`."""
    content = path.read_bytes()
    assert b'comment classes ["wall", "shower curtain"]\n' in content
    table = np.frombuffer(content.partition(b"end_header\n")[2], np.dtype([("numbers", "<f4", 62), ("label", "u1")]))
    assert table["label"].tolist() == [0, 1] * 9
    numbers = table["numbers"]
    # Poses with their last rows, then intrinsics, then bounds.
    expected = [
        *range(12),
        0,
        0,
        0,
        1,
        *range(20, 32),
        0,
        0,
        0,
        1,
        5,
        0,
        3.5,
        0,
        6,
        2.5,
        0,
        0,
        1,
        7,
        0,
        2.5,
        0,
        8,
        1.5,
        0,
        0,
        1,
        0.5,
        8,
        0.25,
        4,
    ]
    assert numbers[:, :3].flatten().tolist() == expected
    red = np.arange(0, 72, 3)  # the first channel of the first photo, 24 pixels, then the second
    colours = np.concatenate([red, red + 1, red[:6] + 2]) / 255
    assert np.allclose(numbers[:, 6:9].flatten(), colours, atol=1e-7)
    assert not numbers[:, 3:6].any()
    assert not numbers[:, 9:54].any()
    assert numbers[9, 54] == pytest.approx(0, abs=1e-6)  # the logit of 10 / 20
    assert np.allclose(numbers[4, 55:58], np.log([5, 6, 7]), atol=1e-6)
    assert numbers[5, 58:].tolist() == [0, 1, 0, 0]
    assert len(load_splat(path).gaussians) == 18


def test_the_python_program_gives_the_network_what_the_file_says_and_writes_what_it_gets(tmp_path: Path):
    write_network(tmp_path / "known.onnx")
    cameras = write_cameras(tmp_path)
    printed = run(sys.executable, EXAMPLES / "onnx_to_ply.py", tmp_path / "known.onnx", cameras, tmp_path / "out.ply")
    assert "18 Gaussians, mostly wall" in printed
    check_known_splat(tmp_path / "out.ply")


def compiled(folder: Path, *options: str | Path) -> Path:
    """The C++ program."""
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("there is no C++ compiler")
    program = folder / "onnx_to_ply"
    run(compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", EXAMPLES / "onnx_to_ply.cpp", "-o", program, *options)
    return program


@pytest.mark.long
def test_the_cpp_program_does_the_same_with_a_stand_in_for_the_runtime(tmp_path: Path):
    program = compiled(tmp_path, "-I", ROOT / "tests" / "support" / "onnxruntime_stub")
    run(program, "known.onnx", write_cameras(tmp_path), tmp_path / "out.ply")
    check_known_splat(tmp_path / "out.ply")
    (tmp_path / "cameras.txt").write_text("0.ppm 1 2 3\n")
    refused = subprocess.run(
        [program, "known.onnx", tmp_path / "cameras.txt", "out.ply"], capture_output=True, text=True
    )
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "expected 2 lines of a name and 18 numbers" in refused.stderr


@pytest.fixture(scope="module")
def views() -> Views:
    """Two photos of the embedded room."""
    return open_scene(demo_scene()).read([1, 3], (240, 320))


@pytest.fixture(scope="module")
def exported(views: Views, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the included network and the photos with their cameras."""
    folder = tmp_path_factory.mktemp("exported")
    command = [sys.executable, "-m", "semgs", "export-network", "small", "--views", "2", "--size", "240x320"]
    printed = run(*command, "--out", folder / "small.onnx")
    assert "small for 2 views of 240x320" in printed
    lines = []
    for k, image in enumerate(views.images):
        Image.fromarray(as_bytes(image)).save(folder / f"{k}.ppm")
        fx, _, cx, _, fy, cy = views.cameras.intrinsics[k, :2].flatten().tolist()
        numbers = (
            fx,
            fy,
            cx,
            cy,
            *views.depth_range[k].tolist(),
            *views.cameras.world_from_camera[k, :3].flatten().tolist(),
        )
        lines.append(" ".join(map(str, (f"{k}.ppm", *numbers))))
    (folder / "cameras.txt").write_text("\n".join(lines) + "\n")
    return folder


def check_room(path: Path, views: Views) -> None:
    """The splat has the Gaussians and classes of the network in PyTorch, but for the few for which a choice is at its limit."""
    rounded = views.changed(images=(views.images * 255).round() / 255)
    expected, found = load("small")(rounded).gaussians, load_splat(path).gaussians
    labels = np.frombuffer(path.read_bytes().partition(b"end_header\n")[2], np.uint8).reshape(-1, 249)[:, -1]
    assert expected.semantic is not None
    for one, other, limit in (
        (found.means, expected.means, 1e-4),
        (found.opacities, expected.opacities, 1e-3),
        (found.colour.scales, expected.colour.scales, 1e-3),
        (found.colour.features[:, :4], expected.colour.features, 1e-3),
        (torch.from_numpy(labels.copy()), expected.semantic.features.argmax(-1), 0.5),
    ):
        assert ((one - other).abs() > limit).float().mean() < 1e-3
    assert {SCANNET20.names[label] for label in np.unique(labels)} >= {"wall", "floor"}


@pytest.mark.long
def test_the_page_lists_the_operators_of_the_included_network_and_they_are_as_it_says(exported: Path):
    page = (ROOT / "docs" / "onnx.md").read_text().partition("| operators |")[2]
    listed = [name for row in re.findall(r"^\| ([A-Z].*?) \|", page, re.MULTILINE) for name in row.split(", ")]
    graph = onnx.load(exported / "small.onnx").graph
    assert sorted(listed) == sorted({node.op_type for node in graph.node})
    constant = {one.name for one in graph.initializer}
    for node in graph.node:
        told = {one.name: onnx.helper.get_attribute_value(one) for one in node.attribute}
        if node.op_type in ("ReduceL2", "ReduceMax", "ReduceMean", "ReduceMin", "ReduceSum", "Squeeze", "Unsqueeze"):
            assert set(node.input[1:]) <= constant
        if node.op_type == "ScatterND":
            assert told["reduction"] == b"none"
        if node.op_type == "Resize":
            modes = {(b"nearest", b"asymmetric"), (b"linear", b"half_pixel")}
            assert (told["mode"], told["coordinate_transformation_mode"]) in modes
            assert told["antialias"] == 0


@pytest.mark.long
def test_the_python_program_makes_the_room_that_pytorch_makes(exported: Path, views: Views):
    program, out = EXAMPLES / "onnx_to_ply.py", exported / "python.ply"
    assert "38,400 Gaussians" in run(sys.executable, program, exported / "small.onnx", exported / "cameras.txt", out)
    check_room(out, views)


@pytest.mark.long
def test_the_cpp_program_makes_the_room_that_pytorch_makes(exported: Path, views: Views):
    runtime = os.environ.get(RUNTIME)
    if runtime is None:
        pytest.skip(
            f"no headers of ONNX Runtime's C++ interface: PyPI and npm have the library without them; set {RUNTIME} to a release"
        )
    library = Path(runtime) / "lib"
    options = ("-I", Path(runtime) / "include", "-L", library, "-lonnxruntime", f"-Wl,-rpath,{library}")
    run(compiled(exported, *options), exported / "small.onnx", exported / "cameras.txt", exported / "cpp.ply")
    check_room(exported / "cpp.ply", views)
