"""The objects of the README's Python part: what they say of themselves, and what they show in a notebook."""

from __future__ import annotations

import base64
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from golden import fill_golden
from networks import preset
from PIL import Image
from ply import read_ply
from posed import posed_views

from semgs import SavedScene, Views, load_scene, open_scene, render, save_ply, save_scene
from semgs.data.demo_scene import demo_scene
from semgs.data.scene import Scene
from semgs.files.images import notebook
from semgs.rendering.rendering import Rendering
from semgs.scene.encoding import Encoding

SIZE = (32, 48)


@pytest.fixture(scope="module")
def views() -> Views:
    labels = torch.full((2, *SIZE), 255, dtype=torch.uint8)
    labels[:, :20] = 5
    return replace(posed_views(2, SIZE), labels=labels, depths=torch.full((2, *SIZE), 2.5))


@pytest.fixture(scope="module")
def encoding(views: Views) -> Encoding:
    return fill_golden(preset("small_plain")).requires_grad_(False)(views)


@pytest.fixture(scope="module")
def rendering(encoding: Encoding, views: Views) -> Rendering:
    return encoding.render(views.cameras)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return open_scene(demo_scene())


def pictures(html: str) -> list[np.ndarray]:
    found = re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    return [np.array(Image.open(io.BytesIO(base64.b64decode(one)))) for one in found]


def test_all_of_them_fit_in_a_few_lines(views: Views, encoding: Encoding, rendering: Rendering, scene: Scene) -> None:
    for one in (views, encoding, rendering, scene, encoding.gaussians, encoding.gaussians.colour, views.cameras):
        assert len(repr(one).splitlines()) <= 14
        assert "tensor" not in repr(one)
        assert max(map(len, repr(one).splitlines())) < 400


def test_what_is_said_are_shapes_and_ranges(views: Views, encoding: Encoding) -> None:
    said = repr(views.changed(depth_range=torch.tensor([[0.5, 8.0], [0.25, 10.0]], dtype=torch.float64)))
    assert said.startswith("Views(\n  images: [2 3 32 48] 0")
    assert "\n  depth_range: [2 2] 0.25 to 10, float64\n" in said
    assert "\n  labels: [2 32 48] 5 to 255, uint8\n" in said
    assert "\n  depths: [2 32 48] 2.5 to 2.5\n" in said
    assert "\n  classes: scannet20, 20 classes\n" in said
    count = len(encoding.gaussians)
    assert f"    means: [{count} 3] " in repr(encoding)
    nothing = encoding.gaussians.map(lambda tensor: tensor[:0])
    assert "  opacities: [0]\n" in repr(nothing)


def test_a_scene_is_a_line_for_each_thing_however_many_frames(scene: Scene) -> None:
    assert repr(scene).startswith("Scene(\n  name: demo\n")
    assert f"\n  frames: {len(scene)} of 240x320 (height x width)\n" in repr(scene)


def test_views_show_photos_classes_with_their_names_and_depth(views: Views) -> None:
    html = views._repr_html_()
    shown = pictures(html)
    assert len(shown) == 6
    np.testing.assert_array_equal(shown[0], np.rint(255 * views.images[0].permute(1, 2, 0).numpy()))
    assert shown[2][10, 10].tolist() == [140, 86, 75]
    assert html.count("sofa") == 1
    assert "background:rgb(140, 86, 75)" in html
    assert "wall" not in html


def test_a_rendering_shows_images_classes_and_depth_by_the_table_of_the_network(rendering: Rendering) -> None:
    assert rendering.classes is not None
    assert len(pictures(rendering._repr_html_())) == 6
    seen = replace(rendering, alphas=torch.ones_like(rendering.alphas), semantics=rendering.semantics.clone().zero_())
    seen.semantics[:, 7] = 1
    assert "door" in seen._repr_html_()
    assert "class 7" in replace(seen, classes=None)._repr_html_()


def test_an_encoding_shows_depth(encoding: Encoding) -> None:
    assert len(pictures(encoding._repr_html_())) == 4


def test_a_scene_shows_some_of_its_frames_and_names_those_that_cannot_be_read(scene: Scene, tmp_path: Path) -> None:
    html = scene._repr_html_()
    assert len(pictures(html)) == notebook.MOST
    assert f"0: {scene.frames[0].name}" in html
    (tmp_path / "broken.png").write_bytes(b"\x89PNG")
    broken = replace(scene.frames[0], picture=tmp_path / "broken.png")
    html = replace(scene, frames=(broken, *scene.frames[1:]))._repr_html_()
    assert len(pictures(html)) == notebook.MOST - 1
    assert "broken.png" in html


def test_many_large_pictures_are_few_and_small_ones() -> None:
    row = notebook.photo_row("images", np.zeros((3, 4, 3, 500, 730), np.float32))
    assert len(row.pictures) == 6
    assert row.note == "the first 6 of 12"
    assert notebook.subsample(row.pictures[0]).shape == (125, 183, 3)


def test_names_that_look_like_html_are_shown_as_they_are() -> None:
    row = notebook.Strip("<script>", (), "a < b", (("<b>", (1, 2, 3)),))
    assert "<script>" not in notebook.html("<i>", [row])
    assert "&lt;b&gt;" in notebook.html("<i>", [row])


def test_the_python_of_the_readme_ends_in_numpy_and_in_files(
    views: Views, encoding: Encoding, rendering: Rendering, tmp_path: Path
) -> None:
    for tensor in (
        encoding.depths, encoding.confidences, encoding.depth_spread, encoding.depth_range, encoding.gaussians.means,
        encoding.gaussians.opacities, encoding.gaussians.colour.features, rendering.images, rendering.semantics, rendering.depths, rendering.alphas,
    ):  # fmt: skip
        assert tensor is not None
        assert np.isfinite(tensor.numpy()).all()
    assert 0 <= rendering.images.min() <= rendering.images.max() <= 1
    save_ply(tmp_path / "gaussians.ply", encoding.gaussians)
    assert len(read_ply(tmp_path / "gaussians.ply")) == len(encoding.gaussians)
    save_scene(tmp_path / "scene.safetensors", SavedScene.of(encoding, views, unit="metric", frames=("a", "b")))
    again = load_scene(tmp_path / "scene.safetensors")
    assert (again.unit, again.frames, again.classes) == ("metric", ("a", "b"), encoding.classes)
    assert again.near == views.depth_range[:, 0].min()
    shown = render(again.gaussians, again.cameras, near=again.near)
    assert torch.equal(shown.images, rendering.images)
    assert len(repr(again).splitlines()) <= 18
