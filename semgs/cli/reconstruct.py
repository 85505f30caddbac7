"""`semgs reconstruct`: posed photos in, a folder with the scene, its renders and a report out."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from semgs.cli.arguments import parse_size
from semgs.cli.device import check_device, chosen_device
from semgs.cli.errors import UsageError, what_fits, what_the_user_gave
from semgs.cli.progress import say_compiling, show_stage
from semgs.cli.scene_options import SceneOptions
from semgs.files.folders import check_folder, own_folder
from semgs.files.paths import existing_folder, typed_path
from semgs.reconstruction.stages import Stages
from semgs.weights.hub import is_hub_id

if TYPE_CHECKING:
    from semgs.data.choice import Choice
    from semgs.data.scene import Scene
    from semgs.model.semgs import SemGS
    from semgs.reconstruction.report import Origin


MOST_VIEWS = 4
"""More context views than this are more than the models are trained with."""


@dataclass(frozen=True)
class Reconstruct:
    """Turn posed photos of a room into a labelled 3D scene of Gaussians, in one forward pass.

    SCENE is a folder with a transforms.json (nerfstudio's or instant-ngp's), a COLMAP model, a ROS bag, a scene of ScanNet, ScanNet++,
    Replica, TUM RGB-D or 7-Scenes, RGB-D frames with poses in text, or what semgs prepare wrote; which it is is found out. Frames are
    counted by their position among the usable ones in file order, from 0; names work too.

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
    - semgs reconstruct recording --out out/robot --camera /camera/color --world map
    - semgs reconstruct scans/office --out out/office --model mvsplat --weights re10k.ckpt
    """

    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """Folder of the scene, or the one file that holds it."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Folder to write: a new one, an empty one, or with --overwrite one that an earlier run wrote."""
    views: int = 2
    """How many frames go in, from 2 to all usable ones. They are chosen by overlap and baseline, and frames that they cover are
    held out to compare with. Fewer go in if no other frame shares 30 % of what it sees. More than 4 is more than the model was
    made for."""
    context: Annotated[tuple[int | str, ...], tyro.conf.arg(metavar="FRAME [FRAME ...]")] = ()
    """Take these frames, by position or name, instead of choosing."""
    size: Annotated[str, tyro.conf.arg(metavar="HxW")] = "auto"
    """Height x width to read the images at, such as 240x320. Images of another aspect are cropped about the middle.
    By default they are reduced, aspect kept, sides rounded to multiples of 16, to at most 76,800 pixels."""
    model: Literal["small", "base", "base_text", "mvsplat"] = "small"
    """small runs on a laptop; base has the paper's sizes; mvsplat knows colour only."""
    weights: Annotated[str, tyro.conf.arg(metavar="PATH")] = "shipped"
    """A file of weights, "shipped" for those inside the package, "random", or hf://OWNER/NAME[@REVISION] to fetch some from the
    Hugging Face hub."""
    device: Annotated[str, tyro.conf.arg(metavar="{auto,cpu,cuda}")] = "auto"
    """Where the network computes; auto takes a CUDA GPU where there is one."""
    overwrite: bool = False
    """Replace DIR if an earlier run wrote it, once the new one is complete."""
    reading: Annotated[SceneOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Reconstruct, write the folder, and say what is in it.

        Raises:
            InputError: the scene, the weights or the output folder cannot be used.
            UsageError: an option asks for what cannot be, or there is too little memory.
        """
        self._check()
        with show_stage("Starting"):
            # Torch takes seconds to import, which nobody should wait for to be told of a typing error.
            from semgs.data.scenes import open_asked

        device = chosen_device(self.device)
        scene = open_asked(self.scene, self.reading.as_peers, self.reading.asked, needs_labels=False)
        stages = Stages(show_stage, say_compiling)
        with stages("choose", f"Choosing among {len(scene)} frames"):
            choice = self._choice(scene)
        with stages("load", f"Loading the model {self.model}"):
            model, origin = self._model(device)

        from semgs.cli.results import summary, write_results
        from semgs.reconstruction.reconstruct import reconstruct

        with own_folder(self.out, self.overwrite) as folder:
            with what_fits():
                result = reconstruct(scene, choice, model, parse_size(self.size), stages=stages, notes=self._notes())
            write_results(folder, result, origin, stages)
        print(summary(result, stages.seconds, self.out))

    def _check(self) -> None:
        """Refuse what can be refused before torch is imported."""
        existing_folder(self.scene)
        check_folder(self.out, self.overwrite)
        parse_size(self.size)
        check_device(self.device)
        self.reading.check()
        if self.views < 2:
            raise UsageError(f"--views is {self.views}; expected 2 or more frames that overlap")
        if len(self.context) == 1:
            raise UsageError("--context names one frame; expected two or more that overlap")
        named = self.weights in ("shipped", "random") or is_hub_id(self.weights)
        if not named and not typed_path(self.weights).is_file():
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
