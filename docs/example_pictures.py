"""Make the images of the pages about examples, from the included room.

    python docs/example_pictures.py

It runs the examples in a temporary folder and writes docs/images/example_*.jpg.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
from PIL import Image

from semgs import load, occupancy
from semgs.data.demo_scene import demo_scene
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20
from semgs.figures.class_images import true_class_picture
from semgs.figures.view_images import as_bytes
from semgs.files.images.colours import depth_limits, depth_picture

ROOT = Path(__file__).resolve().parent.parent
IMAGES = ROOT / "docs" / "images"


def run(name: str, *arguments: str | Path) -> None:
    """Run an example."""
    subprocess.run([sys.executable, ROOT / "examples" / f"{name}.py", *arguments], check=True)


def save(name: str, pictures: list[np.ndarray]) -> None:
    """Images side by side, as a JPEG."""
    Image.fromarray(np.hstack(pictures)).save(IMAGES / f"example_{name}.jpg", quality=85)


def save_plan(name: str, scene: Scene) -> None:
    """The first three photos, and the plan of the floor from them as examples/robot.py finds it: free white, occupied black, unknown grey."""
    views = scene.read([0, 1, 2])
    made = load("small")(views)
    plan = occupancy(made.gaussians, views.cameras, depth_spread=made.depth_spread, stride=made.stride)
    grey = np.select([plan.cells == 0, plan.cells == 100], [254, 0], 160).astype(np.uint8)[::-1]  # y is up
    height = views.size[0]
    width = round(height * grey.shape[1] / grey.shape[0])
    drawn = cv2.resize(grey, (width, height), interpolation=cv2.INTER_NEAREST)[..., None].repeat(3, -1)
    save(name, [*(as_bytes(image) for image in views.images), drawn])


def write_for_the_new_reader(folder: Path, scene: Scene, frames: int = 2) -> None:
    """The first frames of a scene in the layout of examples/new_reader.py; the depth camera has half the pixels."""
    views = scene.read(range(frames), "native")
    for name in ("rgb", "depth", "ids"):
        (folder / name).mkdir(parents=True)
    ids = np.zeros(256, np.uint16)
    ids[[SCANNET20.index(name) for name in ("chair", "table", "wall")]] = 1, 2, 3
    lines = []
    for number in range(frames):
        Image.fromarray(as_bytes(views.images[number])).save(folder / f"rgb/f{number}.png")
        depths = np.rint(views.depths[number, ::2, ::2].numpy() / 0.0002).astype(np.uint16)
        cv2.imwrite(str(folder / f"depth/f{number}.png"), depths)
        cv2.imwrite(str(folder / f"ids/f{number}.png"), ids[views.labels[number].numpy()])
        pose = views.cameras.world_from_camera[number].flatten().tolist()
        lines.append(f"f{number} {' '.join(f'{value:.12g}' for value in pose)}\n")
    (folder / "poses.txt").write_text("".join(lines))
    k = views.cameras.intrinsics[0].numpy()
    colour = {"size": views.size, "focal": [k[0, 0], k[1, 1]], "centre": [k[0, 2], k[1, 2]]}
    depth = {"size": [side // 2 for side in views.size], "focal": [k[0, 0] / 2, k[1, 1] / 2]}
    depth["centre"] = [
        k[0, 2] / 2 + 0.25,
        k[1, 2] / 2 + 0.25,
    ]  # pixel (0, 0) of the smaller map is pixel (0, 0) of the larger one
    (folder / "cameras.json").write_text(json.dumps({"colour": colour, "depth": depth}))


def main() -> None:
    """Write the seven images."""
    scene = open_scene(demo_scene())
    with TemporaryDirectory() as temporary:
        work = Path(temporary)
        run("own_photos", demo_scene(), work / "own")
        shutil.copy(work / "own" / "views.jpg", IMAGES / "example_own_photos.jpg")
        run("arrays_in", demo_scene(), IMAGES / "example_arrays_in.jpg")
        run("depth_maps_in", demo_scene(), work / "placed")
        shutil.copy(work / "placed" / "depth.jpg", IMAGES / "example_depth_maps_in.jpg")

        shutil.copytree(demo_scene(), work / "scenes" / "demo")
        run("train_on_a_folder", work / "scenes", work / "run", "30")
        last = max((work / "run" / "validation").glob("*.png"))
        Image.open(last).convert("RGB").save(IMAGES / "example_train_on_a_folder.jpg", quality=85)

        sys.path.insert(0, str(ROOT / "examples"))
        from new_reader import open_mine

        write_for_the_new_reader(work / "mine", scene)
        views = open_mine(work / "mine").read([0], "native")
        assert views.labels is not None
        assert views.depths is not None
        depths = views.depths[0].numpy()
        maps = [depth_picture(depths, depth_limits(depths)), true_class_picture(views.labels[0].numpy(), SCANNET20)]
        save("new_reader", [as_bytes(views.images[0]), *maps])

        run("robot", demo_scene())
        save_plan("robot", scene)

        run("score_another_method", work / "scenes", work / "scores")
        found = [next((work / "scores" / name).glob("**/N2/*/002.png")) for name in ("low is floor", "small")]
        truth = scene.read([2], (120, 160))
        assert truth.labels is not None
        maps = [truth.labels[0].numpy(), *(np.array(Image.open(path)) for path in found)]
        save("score_another_method", [as_bytes(truth.images[0]), *(true_class_picture(one, SCANNET20) for one in maps)])


if __name__ == "__main__":
    main()
