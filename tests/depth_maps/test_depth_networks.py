"""Depth networks: exported ones with a known formula, and a tiny model of each family of transformers."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import onnx_writer
import pytest
import tiny_models
import torch
from known_scenes import write_scene

from semgs.data.scenes import open_scene
from semgs.depth_maps.alignment import Reference, align
from semgs.depth_maps.opening import (
    PredictedMaps,
    TransformersNetwork,
    open_depth_maps,
    open_exported_network,
    open_transformers_network,
)
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png
from semgs.geometry.cameras import Cameras
from semgs.sources.source import MadeBy, cost_of

SIZE = (40, 60)
A, B = 0.2, 0.01
DESCRIPTION = {
    "size": "any",
    "scaling": {"offset": 0, "scale": 1},
    "layout": "NCHW",
    "dtype": "float32",
    "meaning": "inverse",
}


def write_network(path: Path, **changes: object) -> Path:
    """A network whose map is A + B times the red of each pixel."""
    onnx_writer.write_pixelwise(
        path, np.array([[B, 0, 0]]), np.array([A]), shape=(1, 3, "height", "width"), outputs={"logits": "float32"}
    )
    path.with_suffix(".json").write_text(json.dumps(DESCRIPTION | changes))
    return path


def write_rows(path: Path) -> None:
    """Replace the photos of a scene with ones whose red is the number of the row."""
    image = np.zeros((*SIZE, 3), np.uint8)
    image[..., 0] = np.arange(SIZE[0])[:, None]
    for frame in open_scene(path).frames:
        write_png(path.parent / frame.name, image)


def test_an_exported_network_of_one_over_a_line_gives_scale_and_shift(tmp_path: Path):
    """True inverse depth is 0.5 + 0.02 row, the map 0.2 + 0.01 row: the truth is twice the map plus 0.1."""
    pytest.importorskip("onnxruntime")
    scene = write_scene(tmp_path / "scene", 2, SIZE).path
    write_rows(scene)
    opened = open_scene(scene)
    source = open_depth_maps(str(write_network(tmp_path / "line.onnx", licence="MIT")))(opened)
    assert (source.title, source.meaning) == ("line.onnx (licence MIT)", "inverse")
    maps = torch.stack([source.of(frame, SIZE) for frame in opened.frames])
    rows = torch.arange(SIZE[0])[:, None].expand(SIZE).float()
    torch.testing.assert_close(maps, (A + B * rows).expand(2, *SIZE), rtol=1e-5, atol=1e-6)
    truth = 1 / (0.5 + 0.02 * rows).expand(2, *SIZE)
    apart = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    apart[1, 0, 3] = 100.0  # nothing is shared
    k = torch.tensor([[50.0, 0, 30], [0, 50, 20], [0, 0, 1]], dtype=torch.float64).repeat(2, 1, 1)
    reference = Reference("the truth", truth, torch.full_like(truth, 0.05))
    depths, fits = align(maps, source.meaning, reference, Cameras(apart, k, SIZE))
    torch.testing.assert_close(depths, truth, rtol=1e-4, atol=0)
    for fit in fits:
        assert (fit.scale, fit.shift) == (pytest.approx(2, abs=1e-4), pytest.approx(0.1, abs=1e-4))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"meaning": "metres"}, "expected metric, scaled, inverse, found 'metres'"),
        ({"classes": ["a"]}, "found 'classes'"),
        ({"layout": "NHWC"}, "an input of line.onnx"),
    ],
)
def test_a_description_that_does_not_fit_is_refused(tmp_path: Path, changes: dict, message: str):
    pytest.importorskip("onnxruntime")
    with pytest.raises(InputError, match=message):
        open_exported_network(write_network(tmp_path / "line.onnx", **changes))


def test_several_numbers_for_a_pixel_are_refused(tmp_path: Path):
    pytest.importorskip("onnxruntime")
    path = tmp_path / "two.onnx"
    onnx_writer.write_pixelwise(
        path, np.eye(3)[:2], np.zeros(2), shape=(1, 3, "height", "width"), outputs={"logits": "float32"}
    )
    path.with_suffix(".json").write_text(json.dumps(DESCRIPTION))
    with pytest.raises(InputError, match=r"one finite number for each pixel, found float32 of shape \[1, 2, 40, 60\]"):
        open_exported_network(path)(np.zeros((*SIZE, 3), np.uint8))


FAMILIES = {
    "depth_anything": "inverse", "depth_anything_metric": "metric", "prompt_depth_anything": "metric", "dpt_depth": "inverse",
    "zoedepth": "metric", "depth_pro": "metric",
}  # fmt: skip


@pytest.mark.parametrize("family", FAMILIES)
def test_each_family_gives_a_number_for_each_pixel_with_its_meaning(tmp_path: Path, family: str):
    pytest.importorskip("transformers")
    tiny_models.write_model(tmp_path / family, family)
    (tmp_path / family / "README.md").write_text("---\nlicense: apache-2.0\n---\n")
    network = open_transformers_network(str(tmp_path / family))
    assert network.meaning == FAMILIES[family]
    assert network.made_by.title == f"{family} (licence apache-2.0)"
    image = np.random.default_rng(0).integers(0, 255, (*SIZE, 3), dtype=np.uint8)
    prompt = np.full(SIZE, 2.0, np.float32) if network.prompted else None
    values = network(image, prompt)
    assert values.shape == SIZE
    assert np.ptp(values) > 0 or family == "depth_pro"
    np.testing.assert_array_equal(network(image, prompt), values)
    if network.prompted:
        # A random network adds next to nothing to the sensor's depth.
        np.testing.assert_allclose(values, 2, atol=0.01)
        with pytest.raises(InputError, match="a measured depth of each photo"):
            network(image)
    assert open_transformers_network(str(tmp_path / family), "scaled").meaning == "scaled"


def stub(kind: str, **answer: Any) -> TransformersNetwork:
    """A network that gives the same answer for every image."""
    processor = SimpleNamespace(do_pad=True)
    whole = lambda **options: {"pixel_values": options["images"]}  # noqa: E731
    holder = type("Processor", (), {"__call__": staticmethod(whole), "do_pad": processor.do_pad})()
    model = lambda pixel_values: SimpleNamespace(**answer)  # noqa: E731
    return TransformersNetwork(Path("m"), kind, model, holder, "metric", MadeBy("m", ""))


def test_depth_pro_takes_its_field_of_view_for_the_focal_length():
    """A field of view of 90 degrees is a focal length of half the width: inverse depths 0.25 for a focal length of the width are 0.5."""
    network = stub("depth_pro", predicted_depth=torch.full((1, 6, 6), 0.25), field_of_view=torch.tensor([90.0]))
    np.testing.assert_allclose(network(np.zeros((8, 18, 3), np.uint8)), 2.0, rtol=1e-6)


def test_the_borders_that_zoedepth_reflects_are_cut_off():
    """An image of 8 x 18 has borders of 3 sqrt(4) = 6 and 3 sqrt(9) = 9 pixels, so the map is of 20 x 36."""
    padded = torch.arange(20.0)[:, None] * 100 + torch.arange(36.0)
    values = stub("zoedepth", predicted_depth=padded[None])(np.zeros((8, 18, 3), np.uint8))
    np.testing.assert_allclose(values, padded[6:14, 9:27].numpy(), rtol=1e-6)


def test_a_model_of_another_task_is_refused(tmp_path: Path):
    pytest.importorskip("transformers")
    tiny_models.write_model(tmp_path / "classes", "dpt")
    with pytest.raises(InputError, match="expected a depth network: DPTForDepthEstimation"):
        open_transformers_network(str(tmp_path / "classes"))


def test_a_name_that_is_no_source_is_refused(tmp_path: Path):
    for name, found in ((tmp_path / "none", "nothing"), (__file__, "something else")):
        with pytest.raises(InputError, match=f"expected maps, a folder of depth maps.* found {found}"):
            open_depth_maps(str(name))


def test_the_cost_of_a_network_is_that_of_all_photos(tmp_path: Path):
    pytest.importorskip("onnxruntime")
    scene = open_scene(write_scene(tmp_path / "scene", 2, SIZE).path)
    maps = PredictedMaps(open_exported_network(write_network(tmp_path / "line.onnx")))
    cost = maps.cost(scene.frames)
    assert cost is not None
    assert cost.seconds > 0


def test_a_network_that_completes_a_sensors_depth_is_tried_with_some(tmp_path: Path):
    pytest.importorskip("transformers")
    tiny_models.write_model(tmp_path / "prompted", "prompt_depth_anything")
    scene = open_scene(write_scene(tmp_path / "scene", 2, SIZE).path)
    assert scene.frames[0].depth is not None
    maps = open_depth_maps(str(tmp_path / "prompted"))(scene)
    cost = cost_of(maps, scene.frames)
    assert cost is not None
    assert cost.seconds > 0
    truth = torch.from_numpy(scene.frames[0].measured())
    known = truth > 0
    torch.testing.assert_close(maps.of(scene.frames[0], SIZE)[known].median(), truth[known].median(), rtol=0.2, atol=0)
