"""Our files in programs that are not ours: Khronos' glTF validator, the PlayCanvas engine, splat-transform and its viewer page."""

from __future__ import annotations

import base64
import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from chromium import page_of, picture_of
from glb import read_glb
from node_tools import FOLDER, node, package, splat_transform
from scipy.ndimage import maximum_filter, minimum_filter
from test_gltf import SPLAT, some_scene

from semgs.cli.main import main
from semgs.export.gltf import save_gltf
from semgs.export.ply import DEGREE_0, save_ply, save_semantic_ply
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians, move_cameras, move_gaussians
from semgs.rendering.render import Rendering, render
from semgs.scene.scene_file import SavedScene, load_scene
from semgs.scene.upright import upright

pytestmark = pytest.mark.long

GREY = 0.4
"""The background of the viewer page."""

HALF_TURN = torch.diag(torch.tensor([-1.0, -1.0, 1.0, 1.0], dtype=torch.float64))
"""What viewers do to a PLY: half a turn about z."""

SETTINGS = {
    "version": 2, "tonemapping": "none", "highPrecisionRendering": False, "background": {"color": [GREY] * 3},
    "postEffectSettings": {
        "sharpness": {"enabled": False, "amount": 0},
        "bloom": {"enabled": False, "intensity": 1, "blurLevel": 2},
        "grading": {"enabled": False, "brightness": 0, "contrast": 1, "saturation": 1, "tint": [1, 1, 1]},
        "vignette": {"enabled": False, "intensity": 0.5, "inner": 0.3, "outer": 0.75, "curvature": 1},
        "fringing": {"enabled": False, "intensity": 0.5},
    },
    "animTracks": [], "annotations": [], "startMode": "default",
}  # fmt: skip
"""splat-transform's own settings of the viewer page, without a camera."""


# The demo, and the same room elsewhere.

MOTIONS = {
    "demo": ((1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)),  # z is up
    "z up, turned": ((0.6, -0.8, 0), (0.8, 0.6, 0), (0, 0, 1), (0.4, 0.3, -1)),
    "y down": ((1, 0, 0), (0, 0, -1), (0, 1, 0), (0.2, 1.1, -0.3)),
    "off centre": ((0, 1, 0), (0, 0, 1), (1, 0, 0), (300, -200, 40)),  # x is up
}
"""Where the axes of the demo point in the moved scene, and where its origin is."""


@dataclass(frozen=True)
class Moved:
    """The demo in another frame.

    Attributes:
        scene: in that frame.
        up: the direction that is up there.
    """

    scene: SavedScene
    up: torch.Tensor


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> SavedScene:
    out = tmp_path_factory.mktemp("demo") / "out"
    assert main(["demo", "--out", str(out)]) == 0
    return load_scene(out)


@pytest.fixture(params=MOTIONS)
def moved(demo: SavedScene, request: pytest.FixtureRequest) -> Moved:
    motion = torch.eye(4, dtype=torch.float64)
    motion[:3] = torch.tensor(MOTIONS[request.param], dtype=torch.float64).T
    there = replace(demo, gaussians=move_gaussians(motion, demo.gaussians), cameras=move_cameras(motion, demo.cameras))
    return Moved(there, motion[:3, 2])


def level_camera(scene: SavedScene, down: tuple[float, float, float]) -> Cameras:
    """The first input view as viewers can set it: level, with square pixels and the optical axis in the middle, [1]."""
    pose = scene.cameras.world_from_camera[0].clone()
    right = torch.linalg.cross(torch.tensor(down, dtype=torch.float64), pose[:3, 2])
    pose[:3, 0] = right / right.norm()
    pose[:3, 1] = torch.linalg.cross(pose[:3, 2], pose[:3, 0])
    (height, width), focal = scene.cameras.size, float(scene.cameras.intrinsics[0, 0, 0])
    return Cameras(
        pose[None], torch.tensor([[[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]]]), (height, width)
    )


def ours(scene: SavedScene, camera: Cameras, gaussians: Gaussians | None = None, background: float = GREY) -> Rendering:
    """Our rendering of a scene, or of other Gaussians there, on a grey background."""
    return render(gaussians or scene.gaussians, camera, background=(background,) * 3, near=scene.near)


def image_of(rendering: Rendering) -> np.ndarray:
    """Its image, [h w 3]."""
    return rendering.images[0].permute(1, 2, 0).numpy()


def psnr(a: np.ndarray, b: np.ndarray, where: np.ndarray) -> float:
    return float(-10 * np.log10(((a - b)[where] ** 2).mean()))


# glTF.


@pytest.mark.parametrize("harmonics", [1, 4, 9, 16])
def test_all_that_the_validator_does_not_know_are_the_names_of_the_extension(tmp_path: Path, harmonics: int) -> None:
    save_gltf(tmp_path / "a.glb", some_scene(harmonics))
    issues = json.loads(node("validate.mjs", tmp_path / "a.glb"))["issues"]
    told = [(one["code"], one["pointer"].rpartition("/")[2].partition(":")[0]) for one in issues["messages"]]
    assert told == [("UNSUPPORTED_EXTENSION", "0")] + [("MESH_PRIMITIVE_INVALID_ATTRIBUTE", SPLAT)] * (3 + harmonics)
    assert (issues["numErrors"], issues["numWarnings"], issues["numHints"]) == (3 + harmonics, 0, 0)


def test_splat_transform_makes_the_same_gltf_from_our_ply(tmp_path: Path) -> None:
    """It turns positions, quaternions and harmonics half round about z, from the PLY's axes to glTF's."""
    scene = some_scene(16)
    save_ply(tmp_path / "a.ply", scene.gaussians)
    splat_transform(tmp_path / "a.ply", tmp_path / "theirs.glb")
    save_gltf(tmp_path / "ours.glb", replace(scene, gaussians=move_gaussians(HALF_TURN, scene.gaussians)))
    theirs, own = read_glb(tmp_path / "theirs.glb"), read_glb(tmp_path / "ours.glb")
    names = set(theirs.primitive["attributes"])
    assert names == set(own.primitive["attributes"]) - {"_CLASS", "_CONFIDENCE"}
    for name in names - {f"{SPLAT}:ROTATION"}:
        np.testing.assert_allclose(own.attribute(name), theirs.attribute(name), atol=1e-5, err_msg=name)
    along = (own.attribute(f"{SPLAT}:ROTATION") * theirs.attribute(f"{SPLAT}:ROTATION")).sum(-1)
    np.testing.assert_allclose(abs(along), 1, atol=1e-6)  # q and -q are one rotation


def test_the_playcanvas_engine_draws_the_gltf_as_we_do(demo: SavedScene, tmp_path: Path) -> None:
    scene = upright(demo, "y").scene
    save_gltf(tmp_path / "a.glb", scene)
    camera = level_camera(scene, down=(0, -1, 0))
    pose = camera.world_from_camera[0] @ torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))
    fov = math.degrees(2 * math.atan(camera.size[0] / 2 / float(camera.intrinsics[0, 1, 1])))
    engine = package("playcanvas") / "build/playcanvas.js"
    if not engine.exists():
        pytest.skip("the PlayCanvas engine is not installed; `make long` does")
    with page_of(camera.size) as page:
        page.add_script_tag(path=engine)
        glb = base64.b64encode((tmp_path / "a.glb").read_bytes()).decode()
        script = (FOLDER / "draw_gltf.js").read_text()
        assert page.evaluate(script, [glb, pose.T.flatten().tolist(), fov, GREY]) == 1
        theirs = picture_of(page)
    rendering = ours(scene, camera)
    seen = rendering.alphas[0].numpy() > 0.9
    assert seen.mean() > 0.8
    assert psnr(image_of(rendering), theirs, seen) > 34


# PLY.


@pytest.mark.parametrize("ending", ["spz", "sog"])
def test_splat_transform_keeps_our_gaussians_in_compressed_files(tmp_path: Path, ending: str) -> None:
    scene = some_scene(4)
    save_ply(tmp_path / "a.ply", scene.gaussians)
    splat_transform(tmp_path / "a.ply", "--filter-harmonics", "1", tmp_path / f"b.{ending}")
    splat_transform(tmp_path / f"b.{ending}", tmp_path / "c.glb")
    again, gaussians = read_glb(tmp_path / "c.glb"), move_gaussians(HALF_TURN, scene.gaussians)
    distances = torch.cdist(gaussians.means.double(), torch.tensor(again.attribute("POSITION")).double())
    nearest = distances.argmin(1).numpy()  # they may be in another order
    assert sorted(nearest) == list(range(6))
    assert distances.amin(1).max() < 2e-4
    opacities, scales = (again.attribute(f"{SPLAT}:{name}")[nearest] for name in ("OPACITY", "SCALE"))
    np.testing.assert_allclose(opacities[:, 0], gaussians.opacities, atol=0.005)
    np.testing.assert_allclose(scales, gaussians.colour.scales, rtol=0.15)  # SOG has a table of scales


def viewer_page(path: Path, ply: Path, degree: int, camera: Cameras | None = None) -> str:
    """splat-transform's viewer page of a PLY, as HTML; with the camera if one is given, else as it opens by itself."""
    settings: tuple[str | Path, ...] = ()
    if camera is not None:
        pose, width = HALF_TURN @ camera.world_from_camera[0], camera.size[1]
        initial = {
            "position": pose[:3, 3].tolist(),
            "target": (pose[:3, 3] + pose[:3, 2]).tolist(),
            "fov": math.degrees(2 * math.atan(width / 2 / float(camera.intrinsics[0, 0, 0]))),  # of the longer side
        }
        path.with_suffix(".json").write_text(json.dumps({**SETTINGS, "cameras": [{"initial": initial}]}))
        settings = ("--viewer-settings", path.with_suffix(".json"))
    splat_transform(*settings, ply, "--filter-harmonics", str(degree), path)
    return path.read_text()


def shown(path: Path, html: str, size: tuple[int, int]) -> np.ndarray:
    """The first frame of a viewer page, without its buttons, [h w 3]."""
    path.write_text(html)
    with page_of(size) as page:
        page.add_init_script("window.firstFrame = () => { window.frameIsThere = true; }")
        page.goto(f"{path.as_uri()}?webgl&noui&noanim&fullload")
        page.wait_for_function("window.frameIsThere")
        return picture_of(page)


def painted(gaussians: Gaussians, shape: Appearance, colours: torch.Tensor) -> Gaussians:
    """The Gaussians in other colours, 0..1, with the shapes of one branch."""
    harmonics = ((colours - 0.5) / DEGREE_0)[:, None].to(gaussians.means)
    return Gaussians(gaussians.means, gaussians.opacities, replace(shape, features=harmonics))


def test_the_viewer_page_shows_our_picture_and_our_classes(moved: Moved, tmp_path: Path) -> None:
    scene = upright(moved.scene, "-y").scene
    camera = level_camera(scene, down=(0, 1, 0))
    save_ply(tmp_path / "colour.ply", scene.gaussians)
    page = viewer_page(tmp_path / "colour.html", tmp_path / "colour.ply", 1, camera)
    rendering = ours(scene, camera)
    seen = rendering.alphas[0].numpy() > 0.9
    assert seen.mean() > 0.8
    assert psnr(image_of(rendering), shown(tmp_path / "colour.html", page, camera.size), seen) > 34

    # The shapes of class Gaussians are smaller. What shines through is taken out of both pictures, which black and white behind them tell.
    assert scene.classes is not None
    assert scene.gaussians.semantic is not None
    save_semantic_ply(tmp_path / "classes.ply", scene.gaussians, scene.classes)
    page = viewer_page(tmp_path / "classes.html", tmp_path / "classes.ply", 0, camera)
    behind = f'"background":{{"color":{json.dumps([GREY] * 3, separators=(",", ":"))}}}'
    assert behind in page
    palette = torch.tensor(scene.classes.colours) / 255
    labels = scene.gaussians.semantic.features.argmax(-1)
    hard = painted(scene.gaussians, scene.gaussians.semantic, palette[labels])
    theirs, own = [], []
    for level in (0, 1):
        html = page.replace(behind, f'"background":{{"color":[{level},{level},{level}]}}')
        theirs.append(shown(tmp_path / "classes.html", html, camera.size))
        own.append(image_of(ours(scene, camera, hard, float(level))))
    # Where two classes mix, at their borders, the nearest colour is a matter of rounding.
    our_classes = _nearest(*own, palette.numpy())
    same = _nearest(*theirs, palette.numpy()) == our_classes
    inside = minimum_filter(our_classes, 3) == maximum_filter(our_classes, 3)
    assert inside[seen].mean() > 0.85
    assert same[seen & inside].mean() > 0.99


def _nearest(on_black: np.ndarray, on_white: np.ndarray, palette: np.ndarray) -> np.ndarray:
    """The class whose colour is nearest to that of the Gaussians in each pixel, [h w]."""
    alpha = 1 - (on_white - on_black).mean(-1, keepdims=True)
    colours = on_black / alpha.clip(min=0.05)
    return ((colours[:, :, None] - palette) ** 2).sum(-1).argmin(-1)


def test_the_viewer_page_opens_with_the_floor_below_the_ceiling(moved: Moved, tmp_path: Path) -> None:
    scene = upright(moved.scene, "-y").scene
    heights = moved.scene.gaussians.means.double() @ moved.up
    low, high = heights.quantile(torch.tensor([0.1, 0.9], dtype=torch.float64))
    colours = torch.zeros(len(heights), 3)
    colours[heights < low, 2] = 1
    colours[heights > high, 0] = 1
    save_ply(tmp_path / "a.ply", painted(scene.gaussians, scene.gaussians.colour, colours))
    size = (240, 320)
    frame = shown(tmp_path / "a.html", viewer_page(tmp_path / "a.html", tmp_path / "a.ply", 0), size)
    assert (abs(frame - GREY).max(-1) > 0.05).mean() > 0.2  # it is not empty
    red, _, blue = frame.transpose(2, 0, 1)
    ceiling, floor = red - blue > 0.5, blue - red > 0.5
    assert ceiling.mean() > 0.01
    assert floor.mean() > 0.01
    assert np.nonzero(floor)[0].mean() > np.nonzero(ceiling)[0].mean() + size[0] / 4
