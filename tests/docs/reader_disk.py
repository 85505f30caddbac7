"""The disk of somebody who reads the docs: every file that their examples name, as small as possible, and as it is once all examples have run."""

from __future__ import annotations

import ast
import json
import shutil
import sys
from pathlib import Path

import bags
import cv2
import litert_writer
import miniatures
import numpy as np
import onnx_writer
import predicted_files
import pycolmap_photos
import scannet_writer
import splat_files
import tiny_models
import torch
from correspondences import write_correspondence
from golden import golden_tensor
from image_sets import random_numbers, write_image_set
from safetensors import safe_open
from safetensors.torch import save_file

from paper.bench.bench_file import BenchReport, BenchResult, numbers
from semgs.cli.main import main
from semgs.data.demo_scene import demo_scene
from semgs.data.resampling import resized
from semgs.data.scenes import open_scene
from semgs.model.weights.index import shipped_folder
from semgs_rooms.assets.lock import make_lock, write_lock
from semgs_rooms.sets.room_scenes import RoomSettings, write_scene, write_views

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "docs"))
import example_pictures  # noqa: E402

SIZE = (48, 64)
PROCESSED = (378, 504)
"""Height and width of photos as Depth Anything 3 processes them."""
FRAMES = 6
SCENE_SETS = (
    "scenes", "other", "train_rooms", "val24", "data/rooms", "data/wide", "data/taught", "data/scannet", "scannet/train",
    "scannet/test", "scannetpp/data", "replica", "robot",
)  # fmt: skip
"""Folders of labelled scenes."""
SCANS = ("scene0160_00",)
"""Scans as they are downloaded, and in the list `some.txt`."""
COMMIT = "0123456789abcdef0123456789abcdef01234567"
"""Of the models in the cache of the hub."""
REPORTS = ("before", "after", "segformer", "scannet", "replica", "robot")
"""Evaluations in `eval/` beside `small`."""

PLACEHOLDERS = {
    "SCENE": "room", "RECORDING": "recording", "PHOTOS": "photos", "FILE": "runs/small/weights.safetensors", "FILE.onnx": "segformer.onnx", "DIR": "data/rooms",
    "SCENES": "scans", "ROOMS": "data/rooms", "TEACHER": "data/teacher", "ASSETS": "assets",
    "WORK": "work", "SCANNET": "scannet", "W": "runs/small/weights.safetensors", "OUT": "out",
}  # fmt: skip
"""What a reader puts for the words in capitals."""


def filled(word: str) -> str:
    """A word of a command line with its placeholder replaced: all of it, or what is before the first slash."""
    first, slash, rest = word.partition("/")
    return PLACEHOLDERS.get(word) or PLACEHOLDERS.get(first, first) + slash + rest


def build(disk: Path) -> None:
    """Fill a folder, to be run in that folder."""
    room = open_scene(demo_scene()).read(range(FRAMES), "native")
    (disk / "room").mkdir()
    write_views(disk / "room", room)
    views = resized(room, SIZE)
    for scene in ("scans/office", *(f"{folder}/living" for folder in SCENE_SETS)):
        (disk / scene).mkdir(parents=True)
        things = [*(views.labels > 1).numpy().astype(np.uint16)] if scene == "data/rooms/living" else []
        write_views(disk / scene, views, things=things)
    bags.robot(miniatures.miniature()).write(disk / "recording")
    taken = pycolmap_photos.take(disk / "photos", pycolmap_photos.poses_of(4))
    _write_predictions(disk, taken)
    _write_depth_maps(disk / "depth_maps", room.depths.numpy())
    for name in ("labelled_photos", "photos_kept_back"):
        write_image_set(disk / name, {f"{k}": random_numbers(k, (48, 64)) for k in range(2)})
    _write_for_the_short_reader(disk / "mine" / "kitchen")
    example_pictures.write_for_the_new_reader(disk / "mine" / "hall", open_scene(demo_scene()))
    for name in SCANS:
        scannet_writer.write_raw(disk / "scannet", scannet_writer.scan(lost=()), name)
    (disk / "some.txt").write_text("\n".join(SCANS))
    (disk / "selected_seqs_test.json").write_text(json.dumps({"scene0690_00": ["10", "20", "30"]}))
    _write_networks(disk)
    _write_rooms_aside(disk / "data" / "aside")
    _write_answers(disk, views.labels.numpy())
    _write_results(disk)


def _write_for_the_short_reader(folder: Path) -> None:
    """Pictures, depth and poses as the ten lines of docs/data.md expect them."""
    room = miniatures.miniature().first(FRAMES)
    for number, pose in enumerate(room.poses):
        miniatures.write_picture(folder / f"rgb/{number}.png", cv2.resize(room.images[number], (640, 480)))
        miniatures.write_picture(folder / f"depth/{number}.png", room.depths[number])
        (folder / "pose").mkdir(exist_ok=True)
        (folder / f"pose/{number}.txt").write_text(miniatures.text(pose))


def _write_predictions(disk: Path, taken: pycolmap_photos.Taken) -> None:
    """What Depth Anything 3 would predict of photos: their cameras, and the depth of the plane behind everything."""
    k = np.array(
        [
            [pycolmap_photos.FOCAL, 0, pycolmap_photos.CENTRE[0]],
            [0, pycolmap_photos.FOCAL, pycolmap_photos.CENTRE[1]],
            [0, 0, 1],
        ]
    )
    factor = PROCESSED[1] / pycolmap_photos.SIZE[1]
    k[:2] *= factor
    rows, columns = np.indices(PROCESSED) + 0.5
    rays = np.stack((columns, rows, np.ones(PROCESSED)), -1) @ np.linalg.inv(k).T
    poses = taken.world_from_camera
    depths = [(pycolmap_photos.PLANES[0][1] - pose[2, 3]) / (rays @ pose[2, :3]) for pose in poses]
    images = [cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB) for path in sorted(taken.folder.iterdir())]
    fields = {
        "image": np.stack([cv2.resize(image, PROCESSED[::-1], interpolation=cv2.INTER_CUBIC) for image in images]),
        "depth": np.array(depths, np.float32),
        "conf": np.full((len(poses), *PROCESSED), 9, np.float32),
        "extrinsics": np.linalg.inv(poses)[:, :3].astype(np.float32),
        "intrinsics": np.tile(k, (len(poses), 1, 1)).astype(np.float32),
    }
    predicted_files.save(disk / "predictions.npz", fields)


def _write_depth_maps(folder: Path, depths: np.ndarray) -> None:
    """Depth maps of the room, of unknown scale."""
    folder.mkdir()
    (folder / "depth.json").write_text(json.dumps({"meaning": "scaled"}))
    for number, one in enumerate(depths):
        np.save(folder / f"{number:03d}.npy", one / 3)


def _write_networks(disk: Path) -> None:
    """A segmenter that knows two classes, what these mean, what two mean to another one, and weights of a run."""
    weight = np.array([[20.0, 0, 0], [0, 20, 0]])
    described = {
        "size": "any", "scaling": {"offset": 0, "scale": 255}, "layout": "NCHW", "dtype": "float32", "classes": ["floor", "chair"],
        "output": "logits", "licence": "MIT",
    }  # fmt: skip
    onnx_writer.write_pixelwise(
        disk / "segformer.onnx", weight, np.zeros(2), shape=(1, 3, "height", "width"), outputs={"logits": "float32"}
    )
    (disk / "segformer.json").write_text(json.dumps(described))
    for network in ("segformer", "mosaic"):
        write_correspondence(disk / f"{network}.meaning.json", described["classes"], np.eye(20)[[1, 4]])
    for run in ("runs/small", "runs/photos", "runs/scannet", "runs/sharp", "runs/both", "work/runs/scannet", "work/ablation/seed_0/camera/run"):  # fmt: skip
        (disk / run).mkdir(parents=True)
        shutil.copy(shipped_folder() / "small.safetensors", disk / run / "weights.safetensors")


def _write_answers(disk: Path, labels: np.ndarray) -> None:
    """Class maps and features of the photos of the office, an embedding and a table of classes."""
    (disk / "maps").mkdir()
    (disk / "clip" / "images").mkdir(parents=True)
    wall, rest = ({"name": name, "colour": [level] * 3} for name, level in (("wall", 90), ("rest", 180)))
    table = {"name": "two", "classes": [wall | {"ids": [0]}, rest | {"ids": list(range(1, 20))}]}
    for file in ("maps/classes.json", "table.json"):
        (disk / file).write_text(json.dumps(table))
    rng = np.random.default_rng(0)
    for number, one in enumerate(labels):
        miniatures.write_picture(disk / "maps" / f"{number:03d}.png", one)
        np.save(disk / "clip" / "images" / f"{number:03d}.npy", rng.normal(size=(8, 6, 8)).astype(np.float16))
    np.save(disk / "mug.npy", rng.normal(size=8))


def _write_rooms_aside(folder: Path) -> None:
    """A room with views aside of two input views."""
    write_scene(folder / "scene_00000", RoomSettings(3, SIZE, style="other", aside=True))


def _write_results(disk: Path) -> None:
    """What reconstruct, export and evaluate leave."""
    shutil.copytree(ROOT / "docs" / "scores", disk / "docs" / "scores")
    small = "x".join(map(str, SIZE))
    quick = ("--refine", "1", "--looks", "1", "--size", "120x160")
    run("reconstruct", "room", "--out", "out", "--features", "clip", *quick)
    shutil.copytree(disk / "out", disk / "done")
    shutil.copytree(disk / "done", disk / "demo")
    shutil.move(disk / "done", disk / "out" / "office")
    shutil.copytree(disk / "out" / "office", disk / "out" / "robot")
    run("export", "out/office", "--out", "office", "--as", "ply")
    run("export", "out/office", "--out", "labelled", "--as", "ply", "--labels")
    run("export", "out/office", "--out", "map", "--as", "objects")
    run("export", "out/office", "--out", "splats", "--as", "ply", "gltf", "--frame", "scene")
    for ending in ("ply", "glb"):
        (disk / "splats" / f"gaussians.{ending}").rename(disk / f"office.{ending}")
    splat_files.save(disk / "office.spz", splat_files.spz(3, splat_files.spz_blocks(3)))
    run("evaluate", "small", "--data", "data/rooms", "--views", "2", "--size", small, "--out", "eval/small")
    for name in REPORTS:
        shutil.copytree(disk / "eval" / "small", disk / "eval" / name)
    shutil.copytree(disk / "eval" / "small", disk / "work" / "eval" / "scannet")
    for method in ("theirs", "methods/sray", "methods/gsnerf"):
        shutil.copytree(disk / "eval" / "small" / "predictions", disk / method)
    for moment, seconds in (("before", 0.2), ("after", 0.1)):
        measured = BenchReport({}, (BenchResult("render_n2", seconds),))
        (disk / f"{moment}.json").write_text(json.dumps(numbers(measured)))
    pose = [0.0, 0, 1, 4, 1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 0, 1]
    path = {"render_height": 100, "render_width": 160, "camera_path": [{"camera_to_world": pose, "fov": 90.0}] * 2}
    (disk / "camera_path.json").write_text(json.dumps(path))


def add_what_long_tests_need(disk: Path, assets: Path) -> None:
    """Add furniture, models of the hub and the scripts of the repository.

    Args:
        disk: the folder.
        assets: a folder of meshes and pictures without a lock.
    """
    for name in ("scripts", "tests"):
        (disk / name).symlink_to(ROOT / name)
    scannet_writer.write_extracted(disk / "scannet" / "lsm", scannet_writer.long_scan(64), "scene0690_00")
    scans = ("--data", "scannet/scans", "--scenes", "some.txt", "--protocol", "peers")
    run("evaluate", "small", *scans, "--views", "2", "--size", "48x64", "--out", "scored/scans")
    for method in ("methods/sray", "methods/gsnerf"):
        shutil.copytree(disk / "scored" / "scans" / "predictions", disk / method, dirs_exist_ok=True)
    walks = [f"walk{frames}/scene_0000{room}" for frames in (30, 60, 120) for room in range(3)]
    for name in ("small_house", "fox", "hololens_office", *walks):
        shutil.copytree(disk / "scans" / "office", disk / name)
    for model, kind in (
        ("nvidia--segformer-b0-finetuned-ade-512-512", "segformer"),
        ("CIDAS--clipseg-rd64-refined", "clipseg"),
    ):
        cache = disk / "hub" / f"models--{model}"
        tiny_models.write_model(cache / "snapshots" / COMMIT, kind)
        (cache / "refs").mkdir()
        (cache / "refs" / "main").write_text(COMMIT)
        shutil.copytree(cache / "snapshots" / COMMIT, disk / "models" / kind)
    litert_writer.write_pixelwise(disk / "mosaic.tflite", np.array([[20.0, 0, 0], [0, 20, 0]]), np.zeros(2), SIZE)
    described = json.loads((disk / "segformer.json").read_text()) | {
        "size": SIZE,
        "layout": "NHWC",
        "output": "class numbers",
    }
    (disk / "mosaic.json").write_text(json.dumps(described))
    (disk / "data" / "teacher" / "wide").mkdir(parents=True)
    np.save(disk / "data" / "teacher" / "wide" / "living.npy", np.full((FRAMES, 6, 8, 31), 1 / 31, np.float16))
    _say_smoothness(disk / "work/ablation/seed_0/camera/run/weights.safetensors", 0.0)
    _say_smoothness(disk / "work/runs/scannet/weights.safetensors", 0.001)
    shutil.copytree(assets, disk / "assets")
    write_lock(disk / "assets" / "lock.json", make_lock(disk / "assets"))


def _say_smoothness(path: Path, weight: float) -> None:
    """Let weights say that they were trained with the smoothness loss at that weight, 0 for without."""
    with safe_open(path, "pt") as file:
        tensors, said = {name: file.get_tensor(name) for name in file.keys()}, dict(file.metadata())  # noqa: SIM118
    save_file(tensors, path, said | {"training": json.dumps({"losses": {"smoothness": weight}})})


def add_published_files(disk: Path, shared: Path) -> None:
    """Add networks that others have published, and a checkpoint with the names of MVSplat's tensors."""
    for name in ("deeplabv3plus_mobilenet_v2_ade32.safetensors", "mosaic_ade32.tflite"):
        (disk / name).symlink_to(shared / "pretrained" / name)
    lines = (shared / "reference" / "mvsplat_state_dict.txt").read_text().splitlines()
    shapes = dict(line.split(None, 1) for line in lines if line and not line.startswith("#"))
    state = {f"encoder.{key}": golden_tensor(key, ast.literal_eval(shape)) for key, shape in shapes.items()}
    torch.save({"state_dict": state, "epoch": 3}, disk / "re10k.ckpt")


def run(*words: str) -> None:
    """Run a semgs command."""
    code = main(words)
    assert code == 0, f"semgs {' '.join(words)} ended with {code}"
