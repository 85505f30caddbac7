"""Files that SemGS itself writes and reads: scenes, weights, runs, reports, class maps."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import torch

from semgs.data.scenes import open_scene

ROOT = Path(__file__).resolve().parents[2]


def saved_scene(folder: Path) -> Path:
    from saved_scenes import wall

    from semgs.rendering.temperatures import Temperatures
    from semgs.scene.scene_file import save_scene

    save_scene(folder / "scene.safetensors", wall(temperatures=Temperatures(1.2, 0.9), origin=3.0))
    return folder


def read_saved_scene(path: Path, out: Path, changed: Sequence[str]) -> None:
    """Load a scene and write it as PLY, points and COLMAP files."""
    from semgs.export.camera_files import write_camera_file
    from semgs.export.colmap import image_names
    from semgs.export.ply import save_ply
    from semgs.files.images.notebook import html
    from semgs.scene.scene_file import load_scene

    scene = load_scene(path)
    save_ply(out / "gaussians.ply", scene.gaussians)
    write_camera_file(out / "cameras.json", scene.cameras)
    for name in image_names(scene.frames):
        assert Path(name).name == name, f"the name {name!r} of an image to write"
    html(repr(scene), [])


def weights(folder: Path) -> Path:
    """The settings and class table of `small`, with some tensors."""
    from dataclasses import asdict

    from safetensors.torch import save_file

    from semgs.data.tables.classes import SCANNET20
    from semgs.model import networks
    from semgs.model.weights.header import CHECKSUM
    from semgs.model.weights.load import shipped
    from semgs.model.weights.weights_file import checksum, read_header

    tensors = {"a": torch.arange(6.0).reshape(2, 3), "b": torch.zeros(4, dtype=torch.bfloat16)}
    said = read_header(shipped("small")).metadata
    more = {key: value for key, value in said.items() if len(value) < 20_000}
    settings = {
        "semgs": "2",
        "settings": json.dumps(networks.small().as_json()),
        "classes": json.dumps(asdict(SCANNET20)),
    }
    save_file(tensors, folder / "weights.safetensors", {**more, **settings, CHECKSUM: checksum(tensors)})
    return folder / "weights.safetensors"


def shipped_weights(folder: Path) -> Path:
    from semgs.model.weights.load import shipped

    (folder / "weights.safetensors").write_bytes(shipped("small").read_bytes())  # type: ignore[union-attr]
    return folder / "weights.safetensors"


def read_weights(path: Path, out: Path, changed: Sequence[str]) -> None:
    """Everything that a file of weights is asked, and that the network is built for it."""
    from semgs.files.errors import InputError
    from semgs.model.weights.load import data_terms, find, load, table_of, trained_scenes
    from semgs.model.weights.weights_file import (
        count_parameters,
        is_ours,
        read_header,
        read_scores,
        read_temperatures,
        read_tensors,
    )

    refused: InputError | None = None
    is_ours(path)
    for reader in (
        read_header, read_tensors, read_scores, read_temperatures, count_parameters, table_of, trained_scenes, data_terms, find, lambda one: load("small", one)
    ):  # fmt: skip
        try:
            reader(path)
        except InputError as error:
            refused = refused or error
    if refused is not None and not refused.expected.startswith(
        "a tensor of shape"
    ):  # the small seed is no whole network
        raise refused


def training_run(folder: Path) -> Path:
    from torch import nn

    from semgs.files.atomic import write_json
    from semgs.model import networks
    from semgs.objectives.losses import LossWeights
    from semgs.training.run.checkpoints import save_checkpoint
    from semgs.training.run.run_folder import claim_folder
    from semgs.training.state import TrainingState
    from semgs.training.supervision.supervision import make_supervision
    from semgs.training.training_settings import TrainingSettings

    settings = TrainingSettings(
        model="small_plain", steps=12, size=(16, 24), losses=LossWeights(semantic=0.5), validate_every=6, seed=3
    )
    claim_folder(folder / "run", settings)
    torch.manual_seed(0)
    state = TrainingState.begin(
        nn.Linear(3, 2), make_supervision(settings), settings.learning_rate, settings.average_decay
    )  # type: ignore[arg-type]
    for state.step in (6, 12):
        save_checkpoint(folder / "run/checkpoints", state)
    write_json(folder / "run/network.json", networks.small().as_json())
    write_json(folder / "run/assets.json", ["0" * 64])
    lines = [json.dumps({"step": step, "loss": 0.5, "seconds": 1.0}) for step in range(1, 13)]
    (folder / "run/log.jsonl").write_text("\n".join(lines) + "\n")
    (folder / "run/data.json").write_text(json.dumps(RUN_DATA))
    return folder / "run"


RUN_DATA: dict = {
    "scenes": [{"name": f"scene000{n}_00", "frames": 3, "pixels": [5.0] * 21, "drawn": False} for n in range(2)],
    "rooms": {"pixels": None}, "before": ["scene0002_00"], "terms": '[{"text": "CC0", "own": false}]',
}  # fmt: skip


def read_training_run(path: Path, out: Path, changed: Sequence[str]) -> None:
    from torch import nn

    from semgs.training.data.data_check.scene_record import data_terms_of, scenes_of
    from semgs.training.run.checkpoints import best_checkpoint, newest_checkpoint
    from semgs.training.run.log import RunLog
    from semgs.training.run.run_folder import empty_network, is_finished, read_settings
    from semgs.training.state import TrainingState
    from semgs.training.supervision.supervision import make_supervision

    settings = read_settings(path)
    scenes_of(path / run_record())
    data_terms_of(path / run_record())
    if "run/log.jsonl" in changed and (path / "log.jsonl").exists():
        (out / "log.jsonl").write_bytes((path / "log.jsonl").read_bytes())
        with RunLog(out, 6, 12, None) as log:
            log.say("on")
    newest = newest_checkpoint(path / "checkpoints")
    is_finished(path)
    if newest is not None:
        best_checkpoint(path / "checkpoints", newest)
        state = TrainingState.begin(nn.Linear(3, 2), make_supervision(settings), 1e-3, 0.9)  # type: ignore[arg-type]
        state.restore(newest.tensors, newest.numbers)
    if "run/network.json" in changed:
        empty_network(path, settings)


def run_record() -> str:
    from semgs.training.data.data_check.scene_record import RECORD

    return RECORD


def evaluation_run(folder: Path) -> Path:
    import shutil

    from known_scenes import label_map, write_scene

    from paper.bench.bench_file import FORMAT, VERSION
    from semgs.files.images.pictures import write_png

    scores = sorted((ROOT / "docs/scores").glob("*.json"), key=lambda path: path.stat().st_size)
    shutil.copy(scores[0], folder / "report.json")
    result = {"name": "frame", "repeats": 5, "seconds": 0.1, "seconds_median": 0.1, "peak_memory_mb": 40.0}
    (folder / "bench.json").write_text(
        json.dumps({"format": FORMAT, "version": VERSION, "machine": {"cpu": "a"}, "results": [result]})
    )
    scene = write_scene(folder / "scene", 3)
    place = folder / "predictions/N2/scene"
    place.mkdir(parents=True)
    for index in range(3):
        write_png(place / f"{index:03d}.png", label_map(index))
        write_png(place / f"{index:03d}.colour.png", np.full((36, 48, 3), 90, np.uint8))
        np.save(place / f"{index:03d}.depth.npy", np.full((36, 48), 2.0, np.float32))
    (folder / "predictions/N2/timing.json").write_text(json.dumps({"seconds_encode": 0.5, "seconds_render": 0.1}))
    assert len(scene) == 3
    return folder


def read_evaluation_run(path: Path, out: Path, changed: Sequence[str]) -> None:
    from paper.bench.bench_file import read_bench
    from semgs.evaluation.frames.frame_plan import make_plan
    from semgs.evaluation.frames.protocols import neighbours
    from semgs.evaluation.frames.saved import SavedPredictions, find_view_counts
    from semgs.evaluation.tables.card import card_grids
    from semgs.evaluation.tables.comparison_tables import data_grid, overview_grid
    from semgs.evaluation.tables.saved_report import read_report
    from semgs.evaluation.tables.table_grid import printed

    for name in changed:
        if name == "report.json":
            report = read_report(path / name)
            for grid in (overview_grid(report), data_grid([report]), *card_grids([report])):
                for form in ("text", "markdown", "latex"):
                    printed(grid, form)  # type: ignore[arg-type]
        elif name == "bench.json":
            read_bench(path / name)
        else:
            plan = make_plan("neighbours", neighbours, [open_scene(path / "scene")], (2,), (36, 48))
            saved = SavedPredictions(path / "predictions", "mine")
            assert find_view_counts(path / "predictions") == (2,)
            saved.check(plan)
            for task in plan.tasks:
                saved.read(task)


def segmenter(folder: Path) -> Path:
    """Maps of both kinds, and the files that describe networks, what classes mean, and features."""
    from correspondences import write_correspondence
    from scenes_on_disk import SIZE, TABLE, labelled_views, write_labelled

    from semgs.segmenters.class_map_files import RECORD

    write_labelled(folder / "scene", 3, frames=3)
    maps = folder / "maps/images"
    maps.mkdir(parents=True)
    (folder / "maps/classes.json").write_text(json.dumps(TABLE))
    (folder / "maps" / RECORD).write_text(
        json.dumps({"name": "net", "digest": "0" * 8, "licence": "MIT", "photos": {}})
    )
    from PIL import Image

    labels = labelled_views(3, 3).labels.numpy()
    Image.fromarray(labels[0]).save(maps / "000.png")
    np.savez_compressed(maps / "001.npz", probabilities=np.full((3, *SIZE), 1 / 3, np.float16))
    np.savez(maps / "002.npz", np.full((3, 12, 16), 1 / 3, np.float32))
    described = {
        "size": [24, 32], "layout": "NCHW", "dtype": "float32", "classes": ["wall", "floor", "chair"], "output": "logits", "licence": "MIT",
        "scaling": {"mean": [0.5, 0.4, 0.3], "std": 0.2}, "tensor": "out",
    }  # fmt: skip
    (folder / "network.json").write_text(json.dumps(described))
    votes = {"theirs": [1.0] * 20, "own": [0.5] * 20, "bias": [0.0] * 20}
    write_correspondence(folder / "meaning.json", ("a", "b", "c"), np.full((3, 20), 0.05), votes=votes)
    features = folder / "features/images"
    features.mkdir(parents=True)
    for index in range(3):
        np.save(features / f"{index:03d}.npy", np.full((8, 6, 8), 0.5 + index, np.float16))
    return folder


def read_segmenter(path: Path, out: Path, changed: Sequence[str]) -> None:
    from semgs.segmenters.class_map_files import MapFiles, save_class_map, save_table
    from semgs.segmenters.exported import read_segmenter
    from semgs.segmenters.features.feature_files import FeatureFiles
    from semgs.segmenters.opening import read_correspondence
    from semgs.sources.source import MadeBy

    for name in changed:
        if name == "network.json":
            described = read_segmenter(path / name).input
            height, width = described.size or (24, 32)
            if height * width < 1 << 16:
                assert np.isfinite(described.input_of(np.full((height, width, 3), 90, np.uint8))).all()
        elif name == "meaning.json":
            assert np.isfinite(read_correspondence(path / name).correspondence.table).all()
        else:
            scene = open_scene(path / "scene")
            if name.startswith("features"):
                files = FeatureFiles.opened(path / "features", scene)
                for frame in scene.frames:
                    assert np.isfinite(files.of(frame)).all()
                continue
            maps = MapFiles.opened(path / "maps", scene)
            for frame in scene.frames:
                found = maps.of(frame, (24, 32))
                assert torch.isfinite(found).all()
                torch.testing.assert_close(found.sum(0), torch.ones(24, 32), atol=1e-3, rtol=0, check_dtype=False)
            save_table(out / "maps", maps.classes, MadeBy("net", "0"))
            save_class_map(
                out / "maps",
                scene.frames[0],
                np.full((len(maps.classes), 6, 8), 1 / len(maps.classes), np.float32),
                "0f",
            )


def depth_maps(folder: Path) -> Path:
    from PIL import Image
    from scenes_on_disk import SIZE, write_labelled

    write_labelled(folder / "scene", 3, frames=4)
    maps = folder / "maps/images"
    maps.mkdir(parents=True)
    (folder / "maps/depth.json").write_text('{"meaning": "metric", "unit": 0.002, "licence": "MIT"}')
    Image.fromarray(np.full(SIZE, 1500, np.uint16)).save(maps / "000.png")
    np.savez_compressed(maps / "001.npz", depth=np.full(SIZE, 1.5, np.float16))
    np.save(maps / "002.npy", np.full((12, 16), 1.5, np.float32))
    if find_spec("OpenEXR"):
        import OpenEXR

        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {"Z": np.full(SIZE, 1.5, np.float32)}).write(str(maps / "003.exr"))
    else:
        np.save(maps / "003.npy", np.full(SIZE, 1.5, np.float32))
    described = {
        "size": [24, 32], "layout": "NCHW", "dtype": "float32", "meaning": "inverse", "licence": "MIT",
        "scaling": {"offset": 128, "scale": [58, 57, 57]},
    }  # fmt: skip
    (folder / "network.json").write_text(json.dumps(described))
    return folder


def read_depth_maps(path: Path, out: Path, changed: Sequence[str]) -> None:
    from semgs.depth_maps.map_folder import open_map_folder
    from semgs.depth_maps.opening import read_depth_network

    scene = open_scene(path / "scene")
    if "network.json" in changed:
        read_depth_network(path / "network.json")
    maps = open_map_folder(path / "maps", scene, None)
    for frame in scene.frames:
        found = maps.of(frame, (12, 16))
        assert found.shape == (12, 16)
        assert ((found > 0) | found.isnan() | (maps.meaning == "inverse")).all()


def small_files(folder: Path) -> Path:
    from posed import posed_cameras
    from scenes_on_disk import write_table

    from semgs.export.camera_files import write_camera_file

    write_camera_file(folder / "cameras.json", posed_cameras(3, (24, 32)))
    pose = np.eye(4).ravel().tolist()
    path = {
        "camera_type": "perspective",
        "render_height": 24,
        "render_width": 32,
        "camera_path": [{"camera_to_world": pose, "fov": 60.0}] * 2,
    }
    (folder / "path.json").write_text(json.dumps(path))
    write_table(folder / "classes.json")
    (folder / "scenes.txt").write_text("# mine\n" + "".join(f"scene{number:04d}_00\n" for number in range(12)))
    np.save(folder / "embedding.npy", np.arange(1.0, 9.0))
    return folder


def read_small_files(path: Path, out: Path, changed: Sequence[str]) -> None:
    from semgs.cli.commands.scenes.query import read_embedding
    from semgs.data.scene_lists import read_list
    from semgs.data.tables.class_files import read_class_file
    from semgs.export.camera_files import read_camera_file

    for name in changed:
        if name in ("cameras.json", "path.json"):
            cameras = read_camera_file(path / name)
            assert torch.isfinite(cameras.world_from_camera).all()
        elif name == "classes.json":
            read_class_file(path / name)
        elif name == "scenes.txt":
            read_list(path / name)
            read_list(f"ten:{path / name}")
        else:
            assert torch.isfinite(read_embedding(path / name, 8)).all()
