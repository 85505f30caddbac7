"""Scenes of each layout, as the tests' own writers write them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fuzz.format import Seed, read_scene

TESTS = Path(__file__).resolve().parent.parent
for inside in ("data/layouts/colmap", "data/layouts/rgbd"):
    if str(TESTS / inside) not in sys.path:
        sys.path.append(str(TESTS / inside))  # tests whose writers are used here


def transforms(folder: Path) -> Path:
    from scenes_on_disk import write_labelled, write_table

    write_labelled(folder / "scene", 3, frames=3, change=lambda scene: scene.update(label_set="classes.json"))
    write_table(folder / "scene/classes.json")
    return folder / "scene"


def transforms_of_nerfstudio(folder: Path) -> Path:
    from known_scenes import write_scene

    def change(scene: dict) -> None:
        for key in ("fl_x", "fl_y", "metric"):
            del scene[key]
        scene.update(camera_angle_x=1.1, k1=0.05, k2=-0.01, p1=0.001, p2=0.0, camera_model="OPENCV", applied_scale=0.5)
        scene["applied_transform"] = np.eye(4)[:3].tolist()
        scene["frames"][0].update(fl_x=50.0, fl_y=51.0, mask_path="masks/0.png", instance_file_path="things/0.png")

    write_scene(folder / "scene", 3, (24, 32), change=change)
    return folder / "scene"


def transforms_with_points(form: str) -> Seed:
    """instant-ngp's keys of depth, and sparse points."""

    def write(folder: Path) -> Path:
        from known_scenes import write_scene

        def change(scene: dict) -> None:
            scene.update(ply_file_path="points.ply", integer_depth_scale=0.001)
            for frame in scene["frames"]:
                frame["depth_path"] = frame.pop("depth_file_path")

        write_scene(folder / "scene", 3, (24, 32), change=change)
        points = np.random.default_rng(0).normal(size=(30, 3)).astype("<f4")
        names = "".join(f"property float {name}\n" for name in "xyz")
        head = (
            f"ply\nformat {form} 1.0\nelement vertex 30\n{names}element face 1\nproperty list uchar int a\nend_header\n"
        )
        lines = "".join(f"{x} {y} {z}\n" for x, y, z in points.tolist()).encode()
        body = lines + b"1 0\n" if form == "ascii" else points.tobytes() + bytes((1, 0, 0, 0, 0))
        (folder / "scene/points.ply").write_bytes(head.encode() + body)
        return folder / "scene"

    return write


def other_cameras(program: str) -> Seed:
    def write(folder: Path) -> Path:
        from other_cameras import FISHEYE, write_llff, write_metashape

        if program == "llff":
            return write_llff(folder / "scene")
        text = "<transform><rotation>0 0 1 1 0 0 0 1 0</rotation><translation>10 0 0</translation><scale>2</scale></transform>"
        return write_metashape(folder / "scene", *((program, FISHEYE) if program == "fisheye" else ()), component=text)

    return write


def transforms_in_a_zip(folder: Path) -> Path:
    from phone_captures import zipped

    zipped(transforms(folder / "made"), folder / "scene.zip", "room/")
    import shutil

    shutil.rmtree(folder / "made")
    return folder / "scene.zip"


def prepared(folder: Path) -> Path:
    import shutil

    from known_scenes import write_scene

    from semgs.data.preparation.archive import Preparation, prepare_scene

    prepare_scene(write_scene(folder / "made", 3), folder / "room.zip", Preparation((24, 32)))
    shutil.rmtree(folder / "made")
    return folder / "room.zip"


def read_prepared(path: Path, out: Path, changed: Sequence[str]) -> None:
    from semgs.data.origin.licences import read_record

    read_record(path)
    read_scene(path, out, changed)


def colmap(form: str, model: str) -> Seed:
    def write(folder: Path) -> Path:
        import test_colmap

        test_colmap.write_pictures(folder / "images", model)
        test_colmap.WRITERS[form](folder / "sparse/0", model)
        return folder

    return write


def scannet(extracted: bool) -> Seed:
    def write(folder: Path) -> Path:
        import scannet_writer

        written = scannet_writer.scan(lost=(2,))
        few = scannet_writer.Scan(
            written.poses[:4], written.jpegs[:4], written.depths[:4], written.ids[:4], written.labels[:4], (2,)
        )
        return (scannet_writer.write_extracted if extracted else scannet_writer.write_raw)(folder, few)

    return write


def scannetpp(folder: Path) -> Path:
    import scannetpp_writer

    return scannetpp_writer.write_scan(folder)


def predictions(tool: str) -> Seed:
    def write(folder: Path) -> Path:
        import predicted_files

        predicted_files.save(folder / "scene/predictions.npz", getattr(predicted_files, tool)(predicted_files.SMALL))
        return folder / "scene"

    return write


def replica(folder: Path) -> Path:
    from miniatures import miniature
    from replicas import write_replica

    return write_replica(folder / "office_0/Sequence_1", miniature().first(3))


def posed(writer: str, module: str = "test_rgbd", inside: str = "scene") -> Seed:
    """RGB-D frames with poses in text, as a function of a test writes them."""

    def write(folder: Path) -> Path:
        from importlib import import_module

        from miniatures import miniature

        place = folder / inside
        place.mkdir(parents=True)
        return getattr(import_module(module), writer)(place, miniature().first(3))

    return write


def bag(kind: str) -> Seed:
    def write(folder: Path) -> Path:
        import bags
        from miniatures import miniature

        room = miniature().first(3)
        recorded = bags.robot(room)
        if kind == "ros1":
            recorded = bags.Bag(bags.ROS1)
            bags.add_camera(recorded, room)
            bags.add_tree(recorded, room)
        elif kind == "compressed":
            recorded = bags.Bag()
            recorded.info()
            for index, time in enumerate(bags.times(room)):
                recorded.compressed(time, "/camera/color/image_raw/compressed", bags.jpeg(room.images[index]), "jpeg")
                recorded.stamped(time, "/pose", "map", room.poses[index])
                depth = bytes(12) + bags.rvl(room.depths[index])
                recorded.compressed(time, f"{bags.DEPTH}/compressedDepth", depth, "16UC1; compressedDepth rvl")
        name = "room.bag" if kind == "ros1" else "room"
        return recorded.write(folder / name, "sqlite3" if kind == "sqlite3" else "mcap")

    return write


def phone(kind: str) -> Seed:
    def write(folder: Path) -> Path:
        import shutil

        from miniatures import miniature
        from phone_captures import write_polycam, write_record3d, zipped

        room = miniature().first(3)
        (write_polycam if "polycam" in kind else write_record3d)(folder / "capture", room)
        if "zip" not in kind:
            return folder / "capture"
        archive = zipped(folder / "capture", folder / ("capture.zip" if "polycam" in kind else "capture.r3d"))
        shutil.rmtree(folder / "capture")
        return archive

    return write


POSED = (
    posed("pose_files"), posed("nice_slam", inside="room/results"), posed("redwood"), posed("side_by_side"), posed("sun3d"), posed("by_time"),
    posed("quaternions_and_pgm"), posed("write_tum", "test_tum"), posed("with_intrinsics", "test_frame_files", "kitchen/seq-01"), replica,
)  # fmt: skip
