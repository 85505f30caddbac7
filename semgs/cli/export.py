"""`semgs export`: a reconstructed scene for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from semgs.cli.arguments import nearest
from semgs.cli.errors import UsageError
from semgs.cli.progress import show_stage
from semgs.cli.types import Probability
from semgs.files.errors import InputError
from semgs.files.folders import check_folder, own_folder

if TYPE_CHECKING:
    from jaxtyping import Bool
    from torch import Tensor

    from semgs.export.record import ExportedFile
    from semgs.export.scene import SavedScene
    from semgs.export.upright import Axes, FramedScene, UpDirection

Format = Literal["ply", "points", "mcap", "gltf", "colmap"]

UP_OF: dict[Format, Axes] = {"ply": "-y", "points": "z", "mcap": "z", "gltf": "y", "colmap": "-y"}
"""The direction that is up in the files of each format, as their programs have it."""


@dataclass(frozen=True)
class Export:
    """Write a reconstructed scene for other programs, the right way up.

    SCENE is an output folder of semgs reconstruct, or its scene.safetensors. OUT will contain
    - gaussians.ply (--as ply): 3D Gaussians for splat viewers such as SuperSplat; with --colour classes semantics.ply, coloured by class
    - points.ply (--as points): points with colour, class and confidence, for CloudCompare, Open3D and trimesh
    - points.mcap (--as mcap): the same as a PointCloud2, for RViz and Foxglove; needs pip install '.[ros]'
    - gaussians.glb (--as gltf): 3D Gaussians with classes and confidence, for programs that know KHR_gaussian_splatting; others show points
    - colmap/ (--as colmap): sparse/0 and images, to train 3D Gaussians with gsplat, nerfstudio or the first 3DGS code
    - export.json: for each file, the matrix from its coordinates to those of the scene's poses; and the class table

    docs/export.md says how to open each.

    Examples
    - semgs export out/office --out office
    - semgs export out/office --as ply points --out office --min-opacity 0.1
    - semgs export out/office --as points --classes chair table --min-confidence 0.5 --out chairs
    - semgs export out/office --as colmap --frame scene --out training
    """

    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """Folder from semgs reconstruct, or a scene file."""
    out: Annotated[Path, tyro.conf.arg(metavar="OUT")]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    formats: Annotated[tuple[Format, ...], tyro.conf.arg(name="as")] = ("ply",)
    """What to write; several are possible."""
    frame: Literal["upright", "scene"] = "upright"
    """upright turns the scene so that up is -Y in ply and colmap, +Y in gltf, and +Z in points and mcap, and puts its middle at the origin. scene keeps the
    coordinates of the scene's poses; if they are far from their origin, all is relative to the origin in scene.safetensors."""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """The direction that is up in the scene's coordinates. auto finds it from floors and walls."""
    colour: tuple[Literal["photo", "classes"], ...] = ("photo",)
    """Colours of --as ply; with both, two files."""
    min_opacity: Probability = 0.0
    """Leave out Gaussians that are more transparent than this."""
    min_confidence: Probability = 0.0
    """Leave out Gaussians whose likeliest class is less likely than this. For scenes without classes, it is the confidence of the depth."""
    classes: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME [NAME ...]", help_behavior_hint="")] = ()
    """Write only Gaussians whose likeliest class is one of these. By default, all."""
    overwrite: bool = False
    """Replace OUT from an earlier run, once the new one is complete."""

    def run(self) -> None:
        """Export, and print what was written.

        Raises:
            InputError: the scene cannot be used, or OUT cannot be written.
            UsageError: an option is invalid, or nothing would be written.
            ImportError: a format needs a library that is not installed.
        """
        if not self.formats:
            raise UsageError("--as is empty; expected ply, points, mcap, gltf or colmap")
        if not self.colour:
            raise UsageError("--colour is empty; expected photo or classes")
        if "ply" not in self.formats and self.colour != ("photo",):
            raise UsageError("--colour is for --as ply; points have both colours and classes")
        if self.frame == "scene" and self.up != "auto":
            raise UsageError("--up is for --frame upright; --frame scene turns nothing")
        check_folder(self.out, self.overwrite)
        with show_stage("Reading the scene"):
            from semgs.export.record import write_record
            from semgs.export.scene import load_scene
            from semgs.export.upright import up_of
            from semgs.files.bags import check_bag_library

            if "mcap" in self.formats:
                check_bag_library()
            scene = load_scene(self.scene)
            keep = self._selected(scene)
            up = up_of(scene, self.up) if self.frame == "upright" else None
        notes = [] if up is None or up.certain else [up.warning]
        with own_folder(self.out, self.overwrite) as folder, show_stage("Writing"):
            files = []
            for name in dict.fromkeys(self.formats):
                framed = self._framed(scene, name, up)
                if name == "ply":
                    files += self._write_ply(folder, framed, keep)
                elif name == "gltf":
                    files.append(self._write_gltf(folder, framed, keep))
                elif name == "colmap":
                    files.append(self._write_colmap(folder, framed, keep, notes))
                else:
                    files.append(self._write_points(folder, name, framed, keep))
            write_record(folder, files, up)
        self._print(files, notes)

    def _selected(self, scene: SavedScene) -> Bool[Tensor, " g"]:
        """The Gaussians to write."""
        from semgs.export.selection import selected

        if self.classes and scene.classes is None:
            raise InputError(self.scene, "a scene with classes for --classes", "one with colour and depth only")
        if "classes" in self.colour and scene.classes is None:
            raise InputError(self.scene, "a scene with classes for --colour classes", "one with colour and depth only")
        unknown = [name for name in self.classes if scene.classes and name not in scene.classes.names]
        if unknown and scene.classes:
            known = scene.classes.names
            raise UsageError(
                f"--classes: there is no class {unknown[0]!r}{nearest(unknown[0], known)}; expected some of {', '.join(known)}"
            )
        keep = selected(scene, min_opacity=self.min_opacity, min_confidence=self.min_confidence, classes=self.classes)
        if not keep.any():
            raise UsageError("no Gaussian is left; relax --min-opacity, --min-confidence or --classes")
        return keep

    def _framed(self, scene: SavedScene, name: Format, up: UpDirection | None) -> FramedScene:
        """The scene in the frame of a format's files."""
        from semgs.export.upright import in_own_frame, upright

        return in_own_frame(scene) if up is None else upright(scene, UP_OF[name], up)

    def _write_ply(self, folder: Path, framed: FramedScene, keep: Bool[Tensor, " g"]) -> list[ExportedFile]:
        """Write gaussians.ply, semantics.ply or both."""
        from semgs.export.ply import save_ply, save_semantic_ply
        from semgs.export.record import ExportedFile
        from semgs.export.selection import part_of

        part, names = part_of(framed.scene, keep), []
        if "photo" in self.colour:
            save_ply(folder / "gaussians.ply", part.gaussians)
            names.append("gaussians.ply")
        if "classes" in self.colour and part.classes is not None:
            save_semantic_ply(folder / "semantics.ply", part.gaussians, part.classes)
            names.append("semantics.ply")
        return [ExportedFile(name, framed, len(part.gaussians)) for name in names]

    def _write_gltf(self, folder: Path, framed: FramedScene, keep: Bool[Tensor, " g"]) -> ExportedFile:
        """Write gaussians.glb."""
        from semgs.export.gltf import save_gltf
        from semgs.export.record import ExportedFile

        save_gltf(folder / "gaussians.glb", framed.scene, keep)
        return ExportedFile("gaussians.glb", framed, int(keep.sum()))

    def _write_points(self, folder: Path, name: Format, framed: FramedScene, keep: Bool[Tensor, " g"]) -> ExportedFile:
        """Write points.ply or points.mcap."""
        from semgs.export.points import points_of, save_bag, save_points
        from semgs.export.record import ExportedFile

        points = points_of(framed.scene).only(keep)
        if name == "mcap":
            save_bag(folder / "points.mcap", points)
            return ExportedFile("points.mcap", framed, len(points))
        save_points(folder / "points.ply", points)
        return ExportedFile("points.ply", framed, len(points))

    def _write_colmap(
        self, folder: Path, framed: FramedScene, keep: Bool[Tensor, " g"], notes: list[str]
    ) -> ExportedFile:
        """Write the folder colmap."""
        from semgs.export.colmap import copy_photos, photos_of, save_model, tracks_of
        from semgs.export.points import points_of
        from semgs.export.record import ExportedFile

        tracks = tracks_of(framed.scene)
        keep = keep & tracks.matched
        if not keep.any():
            notes.append("no point is seen by two input views, so points3D.bin is empty")
        model, images = folder / "colmap" / "sparse" / "0", folder / "colmap" / "images"
        model.mkdir(parents=True)
        save_model(model, framed.scene, points_of(framed.scene).only(keep), tracks.only(keep))
        source = self.scene if self.scene.is_dir() else self.scene.parent
        photos = photos_of(source, framed.scene)
        if photos is None:
            notes.append(
                f"{source} has no photos of the input views, so colmap/images is missing; export from a folder of semgs reconstruct"
            )
        else:
            images.mkdir()
            copy_photos(images, framed.scene, photos)
        return ExportedFile("colmap", framed, int(keep.sum()))

    def _print(self, files: list[ExportedFile], notes: list[str]) -> None:
        """Print the files and the notes."""
        from semgs.export.record import FILE_NAME

        rows = []
        for file in files:
            what = "points" if file.name.startswith(("points", "colmap")) else "Gaussians"
            up = "in the scene's coordinates" if file.framed.axes is None else f"up is {file.framed.axes.upper()}"
            rows.append((str(self.out / file.name), f"{file.count:,} {what}, {up}"))
        rows.append((str(self.out / FILE_NAME), "the matrices back to the scene's coordinates"))
        width = max(len(path) for path, _ in rows)
        for path, text in rows:
            print(f"{path:<{width}}  {text}")
        for note in notes:
            print(f"note: {note}")
