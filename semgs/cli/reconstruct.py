"""`semgs reconstruct`: posed photos in, a folder with the scene, its renders and a report out."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from semgs.cli.arguments import parse_size
from semgs.cli.device import check_device, chosen_device
from semgs.cli.errors import UsageError, what_the_user_gave
from semgs.cli.progress import show_stage
from semgs.files.folders import check_folder, own_folder
from semgs.files.paths import existing_folder

if TYPE_CHECKING:
    from semgs.data.choice import Choice
    from semgs.data.scene import Scene
    from semgs.export.scene import SavedScene
    from semgs.model.semgs import SemGS
    from semgs.reconstruction.reconstruct import Reconstruction, Shown
    from semgs.reconstruction.report import Origin


MOST_VIEWS = 4
"""More context views than this are more than the models are trained with."""


@dataclass(frozen=True)
class Reconstruct:
    """Turn posed photos of a room into a labelled 3D scene of Gaussians, in one forward pass.

    SCENE is a folder with a transforms.json (nerfstudio's or instant-ngp's) or a COLMAP model; which one it is is
    found out. Frames are counted by their position among the usable ones in file order, from 0; names work too.

    The output folder holds
    - report.html: one page to look at: photos, renders, class maps, depth, scores, what was chosen and why
    - report.json: all its numbers
    - gaussians.ply: plain 3DGS, for every Gaussian splat viewer; semantics.ply: the same coloured by class
    - scene.safetensors: everything, for semgs.load_scene in Python
    - renders/: for every view image, classes (coloured), labels (class number per pixel, 255 = unseen), depth
    (16-bit millimetres, or float TIFF where the scene's unit is unknown), alpha, and the photo beside them

    It appears only when it is complete. Exit code 2 and one line tell of input that cannot be used.

    Examples
    - semgs reconstruct scans/office --out out/office
    - semgs reconstruct scans/office --out out/office --views 3 --overwrite
    - semgs reconstruct scans/office --out out/office --context 3 7 --size 480x640
    - semgs reconstruct scans/office --out out/office --model mvsplat --weights re10k.ckpt
    """

    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """Folder of the scene, or its transforms.json."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder to write: a new one, an empty one, or with --overwrite one that an earlier run wrote."""
    views: int = 2
    """How many frames go in, from 2 to all usable ones. They are chosen by overlap and baseline, and the frames left
    between them are held out to compare with. More than 4 is more than the model was made for."""
    context: Annotated[tuple[int | str, ...], tyro.conf.arg(metavar="FRAME [FRAME ...]")] = ()
    """Take these frames, by position or name, instead of choosing."""
    size: Annotated[str, tyro.conf.arg(metavar="HxW")] = "auto"
    """Height x width to read the pictures at, such as 240x320. By default they are reduced, aspect kept, sides
    rounded to multiples of 16, to at most 76,800 pixels."""
    model: Literal["small", "base", "mvsplat"] = "small"
    """small runs on a laptop; base has the paper's sizes; mvsplat knows colour only."""
    weights: Annotated[str, tyro.conf.arg(metavar="PATH")] = "shipped"
    """A file of weights, "shipped" for those inside the package, or "random"."""
    device: Annotated[str, tyro.conf.arg(metavar="{auto,cpu,cuda}")] = "auto"
    """Where the network computes; auto takes a CUDA GPU where there is one."""
    overwrite: bool = False
    """Replace DIR if an earlier run wrote it, once the new one is complete."""

    def run(self) -> None:
        """Reconstruct, write the folder, and say what is in it.

        Raises:
            InputError: the scene, the weights or the output folder cannot be used.
            UsageError: an option asks for what cannot be.
        """
        self._check()
        with show_stage("Starting"):
            # Torch and what stands on it take seconds to import, which nobody should wait for to be told of a typing error.
            from semgs.data.scenes import open_scene
            from semgs.export.ply import write_ply, write_semantic_ply
            from semgs.export.scene import FILE_NAME, save_scene
            from semgs.files.atomic import write_json, write_text
            from semgs.reconstruction.reconstruct import reconstruct
            from semgs.reconstruction.renders import write_renders
            from semgs.reconstruction.report import report_numbers
            from semgs.reconstruction.report_page import report_page
            from semgs.reconstruction.stages import Stages

        stages = Stages(show_stage)
        device = chosen_device(self.device)
        scene = open_scene(self.scene)
        with stages("choose", f"Choosing among {len(scene)} frames"):
            choice = self._choice(scene)
        with stages("load", f"Loading the model {self.model}"):
            model, origin = self._model(device)
        with own_folder(self.out, self.overwrite) as folder:
            result = reconstruct(scene, choice, model, parse_size(self.size), stages=stages, notes=self._notes())
            with stages("write", f"Writing {self.out}"):
                write_ply(folder / "gaussians.ply", result.encoding.gaussians)
                if result.classes is not None:
                    write_semantic_ply(folder / "semantics.ply", result.encoding.gaussians, result.classes)
                save_scene(folder / FILE_NAME, saved(result))
                (folder / "renders").mkdir()
                write_renders(folder / "renders", result)
            write_json(folder / "report.json", report_numbers(result, origin, stages.seconds))
            write_text(folder / "report.html", report_page(result, origin, stages.seconds))
        print(summary(result, stages.seconds, self.out))

    def _check(self) -> None:
        """Refuse what can be refused before torch is imported."""
        existing_folder(self.scene)
        check_folder(self.out, self.overwrite)
        parse_size(self.size)
        check_device(self.device)
        if self.views < 2:
            raise UsageError(f"--views is {self.views}; expected 2 or more frames that overlap")
        if len(self.context) == 1:
            raise UsageError("--context names one frame; expected two or more that overlap")
        if self.weights not in ("shipped", "random") and not Path(self.weights).is_file():
            raise UsageError(f"--weights is {self.weights}; expected a file, found nothing there")

    def _notes(self) -> list[str]:
        """What the user should know of the result because of the options."""
        notes = []
        if self.weights == "random":
            notes.append("The weights are random: the network is untrained, and what comes out is noise.")
        if max(self.views, len(self.context)) > MOST_VIEWS:
            notes.append(f"The model was made for 2 to {MOST_VIEWS} views; more may blur what they see together.")
        return notes

    def _choice(self, scene: Scene) -> Choice:
        """The frames that go in and those that are held out."""
        from semgs.data.choice import choose, given

        if self.context:
            with what_the_user_gave():
                return given(scene, self.context)
        if self.views > len(scene):
            raise UsageError(f"--views is {self.views}; expected 2 to {len(scene)}, the usable frames of {scene.path}")
        return choose(scene, self.views)

    def _model(self, device: str) -> tuple[SemGS, Origin]:
        """The network on its device, and where it is from."""
        from semgs import __version__
        from semgs.reconstruction.report import Origin
        from semgs.weights.load import load

        with what_the_user_gave():
            model = load(self.model, None if self.weights == "shipped" else self.weights)
        parameters = sum(parameter.numel() for parameter in model.parameters())
        return model.eval().to(device), Origin(f"semgs {__version__}", model.origin, parameters, device)


def saved(result: Reconstruction) -> SavedScene:
    """A reconstruction as the scene file keeps it."""
    from semgs.export.scene import SavedScene

    scene = result.scene
    transform = None if scene.applied_transform is None else scene.applied_transform.tolist()
    return SavedScene(
        gaussians=result.encoding.gaussians,
        cameras=result.context.views.cameras,
        depths=result.encoding.depths,
        confidences=result.encoding.confidences,
        depth_range=result.context.views.depth_range,
        unit="metric" if result.metric else "unknown",
        classes=result.classes,
        frames=result.context.names,
        source=scene.name,
        model=result.model,
        applied_transform=transform and tuple(tuple(row) for row in transform),
        applied_scale=scene.applied_scale,
    )


def summary(result: Reconstruction, seconds: dict[str, float], out: Path) -> str:
    """What the user reads at the end: what was chosen, how it went, where it is."""
    from semgs.reconstruction.report import outputs
    from semgs.reconstruction.report_page import decibels, length
    from semgs.reconstruction.scores import mean_scores

    metric, bounds = result.metric, result.depth_range
    height, width = result.size
    rows = [
        ("scene", f"{result.scene.name}: {result.scene.layout}, {len(result.scene)} usable frames"),
        ("input", _frames(result.context)),
        ("held out", _frames(result.target) if result.target else "none"),
        ("why", result.choice.reason),
        ("size", f"{height}x{width} (height x width), on disk {'x'.join(map(str, result.native_size))}"),
        ("depth", f"{length(bounds.near, metric)} to {length(bounds.far, metric)}: {bounds.reason}"),
        ("result", f"{len(result.encoding.gaussians):,} Gaussians"),
        ("PSNR", f"input views {decibels(mean_scores(result.context.scores).psnr)}"),
        ("time", ", ".join(f"{name} {value:.1f} s" for name, value in seconds.items())),
        *(("note", sentence) for sentence in result.notes),
    ]
    if result.target is not None:
        held_out = decibels(mean_scores(result.target.scores).psnr)
        rows = [(name, f"held-out views {held_out}, {text}" if name == "PSNR" else text) for name, text in rows]
    written = [(str(out / output.name), output.text) for output in outputs(result)]
    width = max(len(path) for path, _ in written)
    return "\n".join(
        [
            *(f"{name:<9} {text}" for name, text in rows),
            "",
            *(f"{path:<{width}}  {text}" for path, text in written),
            "",
            f"Open {out / 'report.html'} in a browser.",
        ]
    )


def _frames(shown: Shown) -> str:
    """Frames as text: position and name."""
    return ", ".join(f"{position} ({name})" for position, name in zip(shown.positions, shown.names, strict=True))
