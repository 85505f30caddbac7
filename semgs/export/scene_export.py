"""Writes a scene, or a part of it, in each of the formats."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool, Int64, UInt8
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.export.colmap import copy_input_photos, image_names, photos_of, save_model, tracks_of
from semgs.export.export_record import ExportedFile
from semgs.export.gltf import save_gltf
from semgs.export.map_files import IMAGE, VOXELS, save_map, save_voxels
from semgs.export.mesh_files import MeshPart, parts_of, save_mesh_glb, save_mesh_ply
from semgs.export.mjcf import FOLDER as MJCF_FOLDER
from semgs.export.mjcf import Contact, save_mjcf
from semgs.export.ply import save_ply, save_semantic_ply
from semgs.export.points import make_points, save_bag, save_points
from semgs.export.scene_objects import PlacedThing, file_from_scene, floor_of, occupancy_of, place_things, save_objects
from semgs.export.usd import FILE as USD_FILE
from semgs.export.usd import save_usd
from semgs.files.images.pictures import write_png
from semgs.mesh.labelled import LabelledMesh
from semgs.rendering.rendering import UNSEEN
from semgs.robotics.floor import NoFloorError
from semgs.robotics.objects import Objects
from semgs.scene.confidence import class_confidences, class_labels, part_of
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Axes, FramedScene, UpDirection, in_own_frame, up_of, upright

THINGS = "things"
"""The folder of meshes of single things."""


@dataclass(frozen=True, eq=False)
class SceneExport:
    """What is written of a scene.

    Attributes:
        scene: the scene.
        keep: the Gaussians to write.
        up: the direction that is up in the scene, to turn files upright; None writes them in the scene's own frame.
        things: of the scene; None if they were not searched.
        labels: whether gaussians.ply has the class and the confidence of each Gaussian.
        mesh: of the scene, in the frame of its Gaussians; None if none is written.
    """

    scene: SavedScene
    keep: Bool[Tensor, " g"]
    up: UpDirection | None
    things: Objects | None
    labels: bool = False
    mesh: LabelledMesh | None = None

    def frame(self, axes: Axes) -> FramedScene:
        """The scene in the frame of a file in which this direction is up; with z up, the floor is at 0 if one is found."""
        if self.up is None:
            return in_own_frame(self.scene)
        return upright(self.scene, axes, self.up, self._floor if axes == "z" else None)

    @cached_property
    def _floor(self) -> float | None:
        """The height of the floor along the direction that is up; None if there is none, or no unit in which to search it."""
        return None if self.up is None else floor_of(self.scene, self.up)

    @property
    def _instances(self) -> Int64[np.ndarray, " g"] | None:
        """The number of the thing that each Gaussian belongs to."""
        return None if self.things is None else self.things.instances

    def _extra(self) -> dict[str, np.ndarray]:
        """What gaussians.ply has of each Gaussian beside the properties of 3DGS."""
        found = {}
        if self.labels and self.scene.classes is not None:
            found["label"] = class_labels(self.scene).numpy()
            found["confidence"] = class_confidences(self.scene).numpy()
        if self._instances is not None:
            found["instance"] = self._instances
        return found

    def _table(self) -> list[str]:
        """The class table, for the header of a PLY."""
        names = () if self.scene.classes is None else self.scene.classes.names
        return [*(f"label {number} {name}" for number, name in enumerate(names)), f"label {UNSEEN} unseen"]

    def _boxes(self, framed: FramedScene) -> tuple[PlacedThing, ...]:
        """The things in the frame of a file."""
        return () if self.things is None else place_things(self.things, file_from_scene(framed, self.scene))

    def _parts(self, framed: FramedScene, classes: ClassTable | None = None, split: bool = True) -> list[MeshPart]:
        """The parts of the mesh in the frame of a file; only one if it is not split by thing."""
        if self.mesh is None:
            return []
        moved = self.mesh.moved(file_from_scene(framed, self.scene).numpy())
        return parts_of(moved, self.things.things if self.things is not None and split else (), classes)

    def write_ply(self, folder: Path, framed: FramedScene, colours: Collection[str]) -> list[ExportedFile]:
        """Write gaussians.ply for "photo", semantics.ply for "classes", or both."""
        part, names = part_of(framed.scene, self.keep), []
        if "photo" in colours:
            extra = {name: values[self.keep.numpy()] for name, values in self._extra().items()}
            save_ply(folder / "gaussians.ply", part.gaussians, extra, self._table() if "label" in extra else ())
            names.append("gaussians.ply")
        if "classes" in colours and part.classes is not None:
            save_semantic_ply(folder / "semantics.ply", part.gaussians, part.classes)
            names.append("semantics.ply")
        return [ExportedFile(name, framed, len(part.gaussians)) for name in names]

    def write_gltf(self, folder: Path, framed: FramedScene) -> ExportedFile:
        """Write gaussians.glb."""
        save_gltf(folder / "gaussians.glb", framed.scene, self.keep, self._boxes(framed), self._instances)
        return ExportedFile("gaussians.glb", framed, int(self.keep.sum()))

    def write_usd(self, folder: Path, framed: FramedScene) -> ExportedFile:
        """Write scene.usdc."""
        parts = self._parts(framed, framed.scene.classes)
        save_usd(folder / USD_FILE, framed.scene, self.keep, self._boxes(framed), self._instances, parts)
        return ExportedFile(USD_FILE, framed, int(self.keep.sum()))

    def write_mesh(self, folder: Path, endings: Collection[str], per_thing: bool) -> list[ExportedFile]:
        """Write mesh.ply and mesh.glb, as far as these are the endings, or a file for each thing in the folder things."""
        files = []
        if per_thing:
            (folder / THINGS).mkdir()
        for ending in endings:
            framed = self.frame("y" if ending == "glb" else "z")
            parts = self._parts(framed, split=per_thing or ending == "glb")
            for name, some in (
                {f"{THINGS}/{one.name}": [one] for one in parts}.items() if per_thing else [("mesh", parts)]
            ):
                file = f"{name}.{ending}"
                if ending == "glb":
                    save_mesh_glb(folder / file, some, framed.scene)
                else:
                    save_mesh_ply(folder / file, some[0].mesh, self._table() if framed.scene.classes else ())
                files.append(ExportedFile(file, framed, sum(len(one.mesh.faces) for one in some)))
        return files

    def write_mjcf(self, folder: Path, framed: FramedScene, contact: Contact) -> ExportedFile:
        """Write the folder mujoco.

        Raises:
            NoFloorError: no floor was found.
        """
        floor = floor_of(framed.scene, up_of(framed.scene, "z"))
        if floor is None:
            raise NoFloorError("no clear floor")
        (folder / MJCF_FOLDER).mkdir()
        parts, things = self._parts(framed, framed.scene.classes), self._boxes(framed)
        save_mjcf(folder / MJCF_FOLDER, parts, things, floor, contact)
        return ExportedFile(MJCF_FOLDER, framed, len(things))

    def write_points(self, folder: Path, framed: FramedScene, ending: Literal["ply", "mcap"]) -> ExportedFile:
        """Write points.ply or points.mcap."""
        points = make_points(framed.scene, self._instances).only(self.keep)
        (save_bag if ending == "mcap" else save_points)(folder / f"points.{ending}", points)
        return ExportedFile(f"points.{ending}", framed, len(points))

    def write_colmap(
        self,
        folder: Path,
        framed: FramedScene,
        source: Path,
        images_of_views: Sequence[UInt8[np.ndarray, "h w 3"]] | None = None,
    ) -> tuple[ExportedFile, list[str]]:
        """Write the folder colmap; returns also notes about what is missing.

        Args:
            folder: the output folder.
            framed: the scene in the frame of the model.
            source: the folder of `semgs reconstruct` that has the photos of the input views.
            images_of_views: the photos themselves; None takes those of `source`.
        """
        notes = []
        tracks = tracks_of(framed.scene)
        keep = self.keep & tracks.matched
        if not keep.any():
            notes.append("no point is seen by two input views, so points3D.bin is empty")
        model, images = folder / "colmap" / "sparse" / "0", folder / "colmap" / "images"
        model.mkdir(parents=True)
        save_model(model, framed.scene, make_points(framed.scene).only(keep), tracks.only(keep))
        photos = None if images_of_views is not None else photos_of(source, framed.scene)
        if images_of_views is not None:
            images.mkdir()
            for name, image in zip(image_names(framed.scene.frames), images_of_views, strict=True):
                write_png(images / name, image)
        elif photos is None:
            notes.append(
                f"{source} has no photos of the input views, so colmap/images is missing; export from a folder of semgs reconstruct"
            )
        else:
            images.mkdir()
            copy_input_photos(images, framed.scene, photos)
        return ExportedFile("colmap", framed, int(keep.sum())), notes

    def write_objects(self, folder: Path, framed: FramedScene) -> ExportedFile:
        """Write objects.json."""
        boxes = self._boxes(framed)
        save_objects(folder / "objects.json", boxes, framed)
        return ExportedFile("objects.json", framed, len(boxes))

    def write_occupancy(
        self,
        folder: Path,
        framed: FramedScene,
        *,
        resolution: float,
        step: float,
        height: float,
        up_is_known: bool = False,
    ) -> list[ExportedFile]:
        """Write map.pgm, map.yaml and voxels.npz; arguments and errors as for `semgs.occupancy`."""
        up = up_of(framed.scene, "z")
        occupancy = occupancy_of(
            framed.scene, up, resolution=resolution, step=step, height=height, up_is_known=up_is_known
        )
        save_map(folder, occupancy)
        save_voxels(folder, occupancy, framed.scene.classes)
        counts = ((IMAGE, occupancy.cells.size), (VOXELS, occupancy.voxels.size))
        return [ExportedFile(name, framed, count) for name, count in counts]
