"""`semgs export`: a reconstructed scene for other programs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from semgs.files.errors import InputError
from semgs.files.folders import check_folder, own_folder
from semgs.files.text import aligned, did_you_mean
from semgs.run.opened_scene import check_for_robots, open_given
from semgs.run.options.types import Activated, Probability, at_least
from semgs.run.options.words import Words, one_word, optional, positional
from semgs.run.outcome import Outcome, Run
from semgs.run.usage_errors import UsageError
from semgs.runtime.notes import Progress
from semgs.splats.endings import is_splat, lacks_classes

if TYPE_CHECKING:
    from jaxtyping import Bool
    from torch import Tensor

    from semgs.export.export_record import ExportedFile
    from semgs.export.scene_export import SceneExport
    from semgs.mesh.labelled import LabelledMesh
    from semgs.robotics.objects import Objects
    from semgs.scene.opened import OpenedScene
    from semgs.scene.scene_file import SavedScene
    from semgs.scene.upright import Axes, FramedScene, UpDirection

Format = Literal["ply", "points", "mcap", "gltf", "usd", "colmap", "objects", "occupancy", "mesh", "mujoco"]

UP_OF: dict[Format, Axes] = {
    "ply": "-y", "points": "z", "mcap": "z", "gltf": "y", "usd": "z", "colmap": "-y", "objects": "z", "occupancy": "z",
    "mesh": "z", "mujoco": "z",
}  # fmt: skip
"""The direction that is up in the files of each format, as their programs have it."""

NAMES_OF_COUNTS = {
    "points": "points", "colmap": "points", "objects": "things", "map": "cells", "voxels": "voxels", "mesh": "faces",
    "things": "faces", "mujoco": "things",
}  # fmt: skip
"""What the files contain, by the beginnings of their names; others contain Gaussians."""

Metres = Annotated[float, one_word("METRES", at_least(0.0, more=True, finite=True))]
Length = Annotated[float | None, one_word("LENGTH", at_least(0.0, more=True, finite=True)), optional()]
Faces = Annotated[int | None, one_word("COUNT", at_least(1)), optional()]

PARTLY = 3
"""The exit code if some formats are written and others cannot be."""


@dataclass(frozen=True)
class Export(Run):
    """Write a reconstructed scene for other programs, the right way up.

    SCENE is an output folder of semgs reconstruct, its scene.safetensors, or a splat of another program (PLY, SPZ, glTF). OUT will contain
    - gaussians.ply (--as ply): 3D Gaussians for splat viewers such as SuperSplat; with --colour classes semantics.ply, coloured by class
    - points.ply (--as points): points with colour, class and confidence, for CloudCompare, Open3D and trimesh
    - points.mcap (--as mcap): the same as a PointCloud2, for RViz and Foxglove; needs pip install -e '.[ros]'
    - gaussians.glb (--as gltf): 3D Gaussians with classes and confidence, for programs that know KHR_gaussian_splatting; others show points
    - scene.usdc (--as usd): 3D Gaussians by class with semantic labels, for Isaac Sim and usdview; needs pip install -e '.[usd]'
    - colmap/ (--as colmap): sparse/0 and images, to train 3D Gaussians with gsplat, nerfstudio or the first 3DGS code
    - objects.json (--as objects): things with class, upright box and distance; the other files then have the number of the thing that each
    Gaussian belongs to, and gltf and usd have the boxes; needs pip install -e '.[objects]'
    - map.pgm, map.yaml and voxels.npz (--as occupancy): free floor and obstacles for ROS's map_server, and voxels with classes
    - mesh.ply, mesh.glb (--as mesh): triangles with colour, class and confidence, for Blender, MeshLab and game engines; usd then has them too. Needs pip install -e '.[mesh]'
    - mujoco/ (--as mujoco): scene.xml for MuJoCo, with a body for each thing, the floor and walls; needs pip install -e '.[mesh,objects]'
    - export.json: for each file, the matrix from its coordinates to those of the scene's poses; and the class table

    docs/export.md says how to open each, docs/robots.md how to use things and maps, docs/mesh.md how to use meshes.

    Examples
    - semgs export out/office --out office
    - semgs export out/office --as ply points --out office --min-opacity 0.1
    - semgs export out/office --as points --classes chair table --min-confidence 0.5 --out chairs
    - semgs export out/office --as colmap --frame scene --out training
    - semgs export out/office --as objects occupancy --frame scene --out map
    - semgs export out/office --as mesh objects --per-thing --out office-mesh
    - semgs export out/office --as mujoco --contact hull --out office-mujoco
    - semgs export office.spz --as ply gltf --up z --out office
    """

    only_with: ClassVar = {
        "--as ply": ("--colour", "--labels"),
        "--colour photo": ("--labels",),
        "--frame upright": ("--up",),
        "--as occupancy": ("--resolution", "--step-height", "--robot-height"),
        "--as mesh": ("--mesh-format", "--per-thing"),
        "--as mesh mujoco": ("--voxel", "--faces"),
        "--as mujoco": ("--contact",),
    }

    scene: Annotated[Path, positional("SCENE")]
    """Folder from semgs reconstruct, a scene file, or a splat."""
    out: Annotated[Path, Words(metavar="OUT")]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    formats: Annotated[tuple[Format, ...], Words(name="as")] = ("ply",)
    """What to write; several are possible."""
    frame: Literal["upright", "scene"] = "upright"
    """upright turns the scene so that up is -Y in ply and colmap, +Y in gltf, and +Z in all others, and puts its middle at the origin. scene keeps the
    coordinates of the scene's poses; if they are far from their origin, all is relative to the origin in scene.safetensors. A robot's map
    needs scene, and poses with +Z up."""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """The direction that is up in the scene's coordinates. auto finds it from floors and walls; for a splat without --cameras, near to what is usual in its format."""
    cameras: Annotated[Path | None, optional("SCENE")] = None
    """For a splat: the scene with its cameras, in its coordinates."""
    activated: Activated = "auto"
    """A splat as PLY or glTF: whether scales are lengths and opacities 0 to 1, not logarithms and logits; auto is what they look like."""
    colour: tuple[Literal["photo", "classes"], ...] = ("photo",)
    """Colours of --as ply; with both, two files."""
    labels: bool = False
    """Add the columns label (number of the class, 255 for none) and confidence to gaussians.ply, and the names of the classes to its header. Viewers
    that read columns by position cannot read such a file; see docs/export.md."""
    min_opacity: Probability = 0.0
    """Leave out Gaussians that are more transparent than this."""
    min_confidence: Probability = 0.0
    """Leave out Gaussians whose likeliest class is less likely than this. For scenes without classes, it is the confidence of the depth."""
    classes: Annotated[tuple[str, ...], optional("NAME [NAME ...]")] = ()
    """Write only Gaussians whose likeliest class is one of these. By default, all. Meshes have only faces of these classes. Maps always use all Gaussians."""
    resolution: Metres = 0.05
    """Side of the cells of --as occupancy, in metres."""
    step_height: Metres = 0.1
    """Things lower than this above the floor are no obstacle for the robot, in metres."""
    robot_height: Metres = 1.5
    """Things higher than this above the floor are no obstacle for the robot, in metres."""
    voxel: Length = None
    """Side of the voxels of --as mesh and mujoco, in the scene's unit. By default 0.02 in scenes in metres, and a 150th of the median depth in others."""
    mesh_format: tuple[Literal["ply", "glb"], ...] = ("ply", "glb")
    """Files of --as mesh."""
    per_thing: bool = False
    """Write a mesh for each thing, such as things/chair_4.ply, and one for the rest."""
    faces: Faces = None
    """Simplify the mesh to about this number of faces. By default, it keeps all."""
    contact: Literal["box", "hull"] = "box"
    """What things are for contact in --as mujoco: their box or their convex hull."""
    overwrite: bool = False
    """Replace OUT from an earlier run, once the new one is complete."""

    def run(self, progress: Progress) -> Outcome:
        """Export.

        Raises:
            InputError: the scene cannot be used, or OUT cannot be written.
            UsageError: an option is invalid, or nothing would be written.
            ImportError: a format needs a library that is not installed.
        """
        if self.step_height >= self.robot_height:
            raise UsageError(
                f"--step-height is {self.step_height:g} and --robot-height {self.robot_height:g}; expected a smaller step"
            )
        if is_splat(self.scene):
            self._check_splat()
        check_folder(self.out, "export", self.overwrite, (self.scene, self.cameras))
        with progress.stage("Reading the scene"):
            from semgs.export.export_record import write_record
            from semgs.export.scene_export import SceneExport
            from semgs.export.scene_objects import things_of
            from semgs.export.usd import check_usd_library
            from semgs.files.bags import check_bag_library
            from semgs.mesh.surface import check_mesh_libraries
            from semgs.robotics.object_libraries import check_object_libraries
            from semgs.scene.upright import up_of

            if "mcap" in self.formats:
                check_bag_library()
            if "usd" in self.formats:
                check_usd_library()
            if self._with_things:
                check_object_libraries()
            if self._surfaces:
                check_mesh_libraries(self.faces is not None)
            opened = open_given(self.scene, self.cameras, self.up, self.activated)
            scene = opened.scene
            keep = self._selected(scene)
            for_robots = self._with_things or "occupancy" in self.formats
            found_up = up_of(scene, opened.up) if self.frame == "upright" or for_robots else None
            missing: dict[str, InputError] = {}
            if for_robots:
                missing |= self._lacks_for_robots(opened, found_up)
            if len(missing) == len(set(self.formats)):
                raise next(iter(missing.values()))
        notes = [] if found_up is None or found_up.certain else [found_up.warning]
        things = None
        if set(self._with_things) - set(missing) and found_up is not None:
            with progress.stage("Finding things"):
                things = things_of(scene, found_up)
                things = things.only(classes=self.classes, min_confidence=self.min_confidence)
        mesh = None
        if set(self._surfaces) - set(missing):
            with progress.stage("Fusing depth"):
                mesh = self._mesh(scene, things)
        export = SceneExport(scene, keep, found_up if self.frame == "upright" else None, things, self.labels, mesh)
        with own_folder(self.out, "export", self.overwrite) as folder, progress.stage("Writing"):
            files = []
            for name in dict.fromkeys(one for one in self.formats if one not in missing):
                try:
                    files += self._write(folder, name, export, opened, notes)
                except InputError as error:
                    missing[name] = error
            if not files:
                raise next(iter(missing.values()))
            write_record(folder, files, export.up)
        lines = (*([f"note: {opened.note}"] if opened.note else []), *self._lines(files, notes))
        lacking = tuple(f"--as {name} is not written: {why}" for name, why in missing.items())
        return Outcome(lines, tuple(notes), lacking, PARTLY if missing else 0)

    @property
    def _surfaces(self) -> list[Format]:
        """The given formats that have a mesh."""
        return [name for name in self.formats if name in ("mesh", "mujoco")]

    @property
    def _with_things(self) -> list[Format]:
        """The given formats that need things."""
        return [name for name in self.formats if name in ("objects", "mujoco") or (name == "mesh" and self.per_thing)]

    @staticmethod
    def _option(name: Format) -> str:
        """The option that makes a format need things or metres."""
        return "--per-thing" if name == "mesh" else f"--as {name}"

    def _mesh(self, scene: SavedScene, things: Objects | None) -> LabelledMesh:
        """The mesh to write."""
        import numpy as np

        from semgs.mesh.labelled import mesh_of

        try:
            mesh = mesh_of(scene, voxel=self.voxel, instances=None if things is None else things.instances)
        except ValueError as error:
            raise UsageError(f"{self.scene}: {error}") from error
        if mesh.labels is not None and scene.classes is not None and mesh.confidences is not None:
            wanted = mesh.confidences >= self.min_confidence
            if self.classes:
                wanted &= np.isin(mesh.labels, [scene.classes.index(name) for name in self.classes])
            mesh = mesh.only(wanted[mesh.faces].all(1))
        if not len(mesh.faces):
            raise UsageError("no face is left; relax --min-confidence or --classes")
        return mesh if self.faces is None else mesh.simplified(self.faces)

    def _check_splat(self) -> None:
        """Check what a splat of another program can never give, before it is read and up is searched."""
        if given := [*map(self._option, self._with_things), *self._for_classes()]:
            raise lacks_classes(self.scene, given[0])
        if self.cameras is None and "colmap" in self.formats:
            raise UsageError("--as colmap is for training on photos; give the scene that has them with --cameras")
        if self.cameras is None and self._surfaces:
            raise UsageError(
                f"--as {self._surfaces[0]} needs views with depth; give the scene that has them with --cameras"
            )
        if self.cameras is None and "occupancy" in self.formats:
            raise UsageError(
                "--as occupancy needs metres, which a splat has not; give a scene in metres with --cameras"
            )

    def _for_classes(self) -> list[str]:
        """The given options that need classes."""
        options = {
            "--classes": self.classes,
            "--labels": self.labels,
            "--colour classes": "classes" in self.colour,
        }
        return [option for option, wanted in options.items() if wanted]

    def _write(
        self, folder: Path, name: Format, export: SceneExport, opened: OpenedScene, notes: list[str]
    ) -> list[ExportedFile]:
        """Write the files of a format, and add to the notes."""
        framed = export.frame(UP_OF[name])
        if name == "ply":
            return export.write_ply(folder, framed, self.colour)
        if name == "gltf":
            return [export.write_gltf(folder, framed)]
        if name == "usd":
            return [export.write_usd(folder, framed)]
        if name == "colmap":
            file, missing = export.write_colmap(
                folder, framed, self.scene if self.scene.is_dir() else self.scene.parent, opened.photos
            )
            notes += missing
            return [file]
        if name == "objects":
            return [export.write_objects(folder, framed)]
        if name == "mesh":
            return export.write_mesh(folder, self.mesh_format, self.per_thing)
        if name == "mujoco":
            with self._floor_is_needed():
                return [export.write_mjcf(folder, framed, self.contact)]
        if name == "occupancy":
            return self._write_occupancy(folder, framed, export)
        return [export.write_points(folder, framed, "mcap" if name == "mcap" else "ply")]

    def _write_occupancy(self, folder: Path, framed: FramedScene, export: SceneExport) -> list[ExportedFile]:
        """Write the map and the voxels."""
        try:
            with self._floor_is_needed():
                return export.write_occupancy(
                    folder,
                    framed,
                    resolution=self.resolution,
                    step=self.step_height,
                    height=self.robot_height,
                    up_is_known=self.up != "auto",
                )
        except InputError:
            raise
        except ValueError as error:  # the grid is too large, or the scene has neither grid nor depth
            raise UsageError(str(error)) from error

    @contextmanager
    def _floor_is_needed(self) -> Iterator[None]:
        """Say of a scene in which no floor is found that it cannot be used."""
        from semgs.robotics.floor import NoFloorError

        try:
            yield
        except NoFloorError as error:
            raise InputError(self.scene, "a scene that shows the floor", str(error)) from error

    def _selected(self, scene: SavedScene) -> Bool[Tensor, " g"]:
        """The Gaussians to write."""
        from semgs.scene.confidence import selected

        if scene.classes is None and (given := self._for_classes()):
            raise InputError(self.scene, f"a scene with classes for {given[0]}", "one with colour and depth only")
        known = () if scene.classes is None else scene.classes.names
        if unknown := [name for name in self.classes if name not in known]:
            raise UsageError(
                f"--classes: there is no class {unknown[0]!r}{did_you_mean(unknown[0], known)}; expected some of {', '.join(known)}"
            )
        keep = selected(scene, min_opacity=self.min_opacity, min_confidence=self.min_confidence, classes=self.classes)
        if not keep.any():
            raise UsageError("no Gaussian is left; relax --min-opacity, --min-confidence or --classes")
        return keep

    def _lacks_for_robots(self, opened: OpenedScene, up: UpDirection | None) -> dict[str, InputError]:
        """Why a scene has not what things and maps need, by the format."""
        found: dict[str, InputError] = {}
        for name in dict.fromkeys(self.formats):
            if name in self._with_things or name == "occupancy":
                try:
                    check_for_robots(self.scene, opened, self._option(name), classes=name != "occupancy")
                except InputError as error:
                    found[name] = error
        if {"occupancy", "mujoco"} & set(self.formats) and self.frame == "scene":
            self._check_z_is_up(up)
        return found

    def _check_z_is_up(self, up: UpDirection | None) -> None:
        """Check that a map in the scene's coordinates is level."""
        from semgs.export.scene_objects import Z_IS_UP

        if up is not None and up.direction[2] < Z_IS_UP:
            direction = ", ".join(f"{side:.2f}" for side in up.direction.tolist())
            raise UsageError(
                f"a map or a simulation in --frame scene needs poses with z up; here up is ({direction}); leave out --frame to turn the scene upright"
            )

    def _lines(self, files: list[ExportedFile], notes: list[str]) -> list[str]:
        """The files and the notes."""
        from semgs.export.export_record import FILE_NAME

        rows = []
        for file in files:
            what = NAMES_OF_COUNTS.get(file.name.split(".")[0].split("/")[0], "Gaussians")
            up = "in the scene's coordinates" if file.framed.axes is None else f"up is {file.framed.axes.upper()}"
            rows.append((str(self.out / file.name), f"{file.count:,} {what}, {up}"))
        rows.append((str(self.out / FILE_NAME), "the matrices back to the scene's coordinates"))
        return [*aligned(rows), *(f"note: {note}" for note in notes)]
