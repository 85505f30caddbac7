"""The formats that are damaged."""

from __future__ import annotations

from fuzz.format import Format, read_scene
from fuzz.images import pictures, read_pictures
from fuzz.results import (
    depth_maps,
    evaluation_run,
    read_depth_maps,
    read_evaluation_run,
    read_saved_scene,
    read_segmenter,
    read_small_files,
    read_training_run,
    read_weights,
    saved_scene,
    segmenter,
    shipped_weights,
    small_files,
    training_run,
    weights,
)
from fuzz.scenes import (
    POSED,
    bag,
    colmap,
    other_cameras,
    phone,
    predictions,
    prepared,
    read_prepared,
    scannet,
    scannetpp,
    transforms,
    transforms_in_a_zip,
    transforms_of_nerfstudio,
    transforms_with_points,
)
from fuzz.splats import GLTF, PLAIN, SPZ, read_splat

LAYOUTS = "semgs/data/layouts"

FORMATS = {
    one.name: one
    for one in (
        Format(
            "transforms", (transforms, transforms_of_nerfstudio), ("*.json",), read_scene,
            (f"{LAYOUTS}/transforms_json.py", f"{LAYOUTS}/parts/fields.py", "semgs/data/tables/class_files.py", "semgs/files/strict_json.py"),
        ),
        Format(
            "colmap-text", (colmap("text", "OPENCV"), colmap("text", "SIMPLE_RADIAL")), ("*.txt",), read_scene, (f"{LAYOUTS}/colmap/*.py",)
        ),
        Format(
            "colmap-binary", (colmap("binary", "OPENCV"), colmap("binary", "PINHOLE")), ("*.bin",), read_scene, (f"{LAYOUTS}/colmap/*.py",)
        ),
        Format(
            "scannet", (scannet(False), scannet(True)), ("*.sens", "*.zip", "*.tsv", "*.txt"), read_scene, (f"{LAYOUTS}/scannet/*.py",)
        ),
        Format("scannetpp", (scannetpp,), ("*.ply", "*.json", "*.txt", "*.tsv"), read_scene, (f"{LAYOUTS}/scannetpp/*.py",)),
        Format(
            "poses", POSED, ("*.txt", "*.json", "*.log", "*.pgm"), read_scene,
            (f"{LAYOUTS}/rgbd/*.py", f"{LAYOUTS}/replica/*.py", f"{LAYOUTS}/parts/*.py"),
        ),
        Format(
            "bags", (bag("mcap"), bag("sqlite3"), bag("ros1"), bag("compressed")), ("*",), read_scene, (f"{LAYOUTS}/ros/*.py", "semgs/files/bags.py")
        ),
        Format(
            "phones", (phone("polycam"), phone("record3d"), phone("polycam zip"), phone("record3d zip")), ("*.json", "*metadata", "*.zip", "*.r3d", "*.conf"),
            read_scene, (f"{LAYOUTS}/phones/*.py",),
        ),
        Format(
            "predictions", (predictions("vggt"), predictions("map_anything"), predictions("map_anything_app"), predictions("dust3r")), ("*.npz",),
            read_scene, (f"{LAYOUTS}/predictions/*.py", "semgs/files/arrays.py"),
        ),
        Format(
            "archives", (transforms_in_a_zip, prepared), ("*.zip",), read_prepared, ("semgs/files/archives.py", "semgs/data/origin/licences.py"), sealed=True
        ),
        Format("pictures", (pictures,), ("*",), read_pictures, ("semgs/files/images/pictures.py", "semgs/files/images/heic.py", "semgs/files/arrays.py")),
        Format(
            "sparse-points", (transforms_with_points("ascii"), transforms_with_points("binary_little_endian")), ("*.ply", "*.json"), read_scene,
            (f"{LAYOUTS}/transforms_json.py", f"{LAYOUTS}/parts/sparse_points.py", "semgs/data/ply_tables.py"),
        ),
        Format(
            "other-cameras", (other_cameras("frame"), other_cameras("fisheye"), other_cameras("llff")), ("*.xml", "*.npy"), read_scene,
            (f"{LAYOUTS}/metashape.py", f"{LAYOUTS}/llff.py"),
        ),
        Format("splats-ply", PLAIN, ("*",), read_splat, ("semgs/splats/*ply*.py", "semgs/data/ply_tables.py", "semgs/splats/splat.py")),
        Format("splats-spz", SPZ, ("*",), read_splat, ("semgs/splats/spz.py", "semgs/splats/splat.py")),
        Format("splats-gltf", GLTF, ("*",), read_splat, ("semgs/splats/gltf_*.py", "semgs/files/gltf_container.py", "semgs/splats/nerfstudio_frame.py")),
        Format("scenes", (saved_scene,), ("*",), read_saved_scene, ("semgs/scene/scene_file.py", "semgs/files/tensor_files.py")),
        Format(
            "weights", (weights, weights, weights, shipped_weights), ("*",), read_weights,
            ("semgs/model/weights/weights_file.py", "semgs/model/weights/load.py", "semgs/model/weights/header.py", "semgs/model/weights/pretrained.py"), 2_000,
        ),
        Format(
            "training", (training_run,), ("*.json", "*.jsonl", "*.safetensors"), read_training_run,
            ("semgs/training/run/checkpoints.py", "semgs/training/run/run_folder.py", "semgs/training/training_settings.py", "semgs/training/state.py"),
        ),
        Format(
            "evaluation", (evaluation_run,), ("*.json", "predictions/*"), read_evaluation_run,
            ("semgs/evaluation/tables/evaluation_report.py", "semgs/evaluation/frames/saved.py", "paper/bench/bench_file.py"),
        ),
        Format(
            "segmenters", (segmenter,), ("maps/*", "*.json", "features/*", "scene/transforms.json"), read_segmenter,
            ("semgs/segmenters/class_map_files.py", "semgs/segmenters/opening.py", "semgs/segmenters/features/feature_files.py"),
        ),
        Format(
            "depth-maps", (depth_maps,), ("maps/*", "*.json"), read_depth_maps,
            ("semgs/depth_maps/map_folder.py", "semgs/depth_maps/opening.py", "semgs/sources/network_files.py"),
        ),
        Format(
            "small-files", (small_files,), ("*",), read_small_files,
            ("semgs/export/camera_files.py", "semgs/data/tables/class_files.py", "semgs/data/scene_lists.py", "semgs/files/arrays.py"),
        ),
    )
}  # fmt: skip
"""By name."""
