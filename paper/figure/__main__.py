"""`python -m paper.figure`: plots one of the paper's comparison figures from weights, saved predictions and scenes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from paper.program import run
from semgs.cli.progress import show_progress, show_stage
from semgs.figures.plotting import check_plotting
from semgs.files.errors import InputError
from semgs.files.folders import check_apart, check_folder, own_folder
from semgs.files.paths import existing_folder, files_among, typed_path
from semgs.files.strict_json import parse_json
from semgs.files.text import counted
from semgs.run.device import chosen_device
from semgs.run.options.scene_options import SceneOptions
from semgs.run.options.types import AutoSize, Count, Device, Protocol, SeveralWeights, Views
from semgs.run.options.words import INLINE, Words, optional, positional
from semgs.run.usage_errors import UsageError, what_fits, what_the_user_gave

if TYPE_CHECKING:
    from paper.figure.compared_targets import ComparedTarget, FigurePart
    from semgs.evaluation.frames.predictions import Method

WITHOUT, WITH = "without smoothness", "with smoothness"
"""The columns of the smoothness figure."""


@dataclass(frozen=True)
class PaperFigure:
    """Plot one of the paper's comparison figures. Rows are frames; columns are the inputs, each method, ours and the truth.

    - qualitative: methods on one or more data sets, one below the other
    - generalisation: the same on data that no method was trained on, side by side; without labels, the photo is the last column
    - smoothness: weights trained without and with the smoothness loss, such as the last two variants of python -m paper.ablate

    Frames are spread evenly over the targets of the protocol, so they are not hand-picked; --targets selects others.
    The output folder contains figure.png, figure.pdf and figure.json, with the scores of the frames shown. It appears only once it is
    complete.

    Examples
    - python -m paper.figure qualitative --weights scannet.safetensors --data data/scannet --protocol peers --out fig/scannet
    - python -m paper.figure qualitative --weights a.safetensors b.safetensors --data data/scannet data/scannetpp --out fig/both
      --predictions S-Ray=theirs/sray GSNeRF=theirs/gsnerf
    - python -m paper.figure generalisation --weights scannet.safetensors --data data/replica data/robot --out fig/elsewhere
    - python -m paper.figure smoothness --weights camera.safetensors full.safetensors --data data/scannet --views 4 --out fig/smoothness
    """

    kind: Annotated[Literal["qualitative", "generalisation", "smoothness"], positional("KIND")]
    """Which figure."""
    weights: SeveralWeights
    """"small" for the included weights, or a file: one for all data, or one for each. For smoothness: without, then with."""
    data: Annotated[tuple[Path, ...], Words(metavar="DIR [DIR ...]")]
    """A scene or a folder of scenes. Each DIR becomes one part of the figure."""
    out: Annotated[Path, Words(metavar="DIR")]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    predictions: Annotated[tuple[str, ...], optional("NAME=DIR ...")] = ()
    """Label maps of other methods, in the format of semgs evaluate; one column each."""
    scenes: Annotated[tuple[str, ...], optional("LIST ...")] = ()
    """For each DIR, only the scenes of a list; see docs/reproduce.md."""
    protocol: Protocol = ("neighbours",)
    """neighbours, peers, or pinned FILE."""
    views: Views = 2
    """Number of input views."""
    rows: Count = 4
    """Frames from each DIR."""
    targets: Annotated[tuple[str, ...], optional("SCENE/FRAME ...")] = ()
    """Show these frames instead, named like prediction files: scene0160_00/22."""
    names: Annotated[tuple[str, ...], optional("NAME ...")] = ()
    """Titles of the parts; by default the folder names."""
    size: AutoSize = None
    """Height x width for the comparison; by default 240x320, or 320x240 for portrait scenes."""
    device: Device = "auto"
    """Where to compute; auto uses a CUDA GPU if there is one."""
    overwrite: bool = False
    """Replace an output folder from an earlier run, once the new result is complete."""
    reading: Annotated[SceneOptions, INLINE] = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Plot the figure and write the folder.

        Raises:
            InputError: data, weights, predictions or the output folder cannot be used.
            UsageError: an option is invalid.
        """
        self._check()
        with show_stage("Starting"):
            from paper.figure.compared_targets import comparison_block, comparison_legend, comparison_numbers
            from paper.figure.comparison import comparison
            from semgs.files.atomic import write_bytes, write_json

            parts = [self._part(index) for index in range(len(self.data))]
        there = {task.truth_stem for part in parts for task in part.plan.tasks}
        if missing := [name for name in self.targets if name not in there]:
            raise UsageError(f"--targets {missing[0]}: no --data folder has this scene")
        tables = list(dict.fromkeys(part.classes for part in parts))
        if len(tables) > 1:
            raise InputError(self.data[-1], f"labels of table {tables[0].name}", tables[1].name)
        blocks, numbers = [], []
        shown: list[ComparedTarget] = []
        with what_fits(), show_progress("Rendering", sum(len(part.plan.tasks) for part in parts)) as done:
            for part in parts:
                frames = []
                for one in part.compare():
                    frames.append(one)
                    done(len(shown) + len(frames))
                titled = len(parts) > 1 or bool(self.names)
                blocks.append(comparison_block(part.title if titled else "", frames, part.columns))
                numbers.append(
                    {
                        "data": part.title,
                        "protocol": part.plan.protocol,
                        "frames": comparison_numbers(frames, part.columns),
                    }
                )
                shown += frames
        with own_folder(self.out, "figure", self.overwrite) as folder:
            files = comparison(
                blocks, comparison_legend(shown), beside=self.kind == "generalisation", forms=("png", "pdf")
            )
            for form, content in files.items():
                write_bytes(folder / f"figure.{form}", content)
            write_json(folder / "figure.json", {"figure": self.kind, "views": self.views, "parts": numbers})
        print(f"{self.out / 'figure.png'}: {counted(len(shown), 'frame')}; {self.out / 'figure.json'} has their scores")

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        check_plotting()
        for folder in self.data:
            existing_folder(folder)
        if not self.data or not self.weights:
            raise UsageError("expected --data DIR and --weights W; see python -m paper.figure --help")
        if self.kind == "smoothness" and (len(self.weights) != 2 or self.predictions):
            raise UsageError(
                "smoothness compares two weights, the first trained without it, the second with it; --predictions do not apply"
            )
        if self.kind != "smoothness" and len(self.weights) not in (1, len(self.data)):
            raise UsageError(
                f"{len(self.weights)} weights for {len(self.data)} --data folders; expected one for all, or one for each"
            )
        for option, given in (("--scenes", self.scenes), ("--names", self.names)):
            if given and len(given) != len(self.data):
                raise UsageError(
                    f"{option} has {len(given)} names; expected one for each of the {len(self.data)} --data folders"
                )
        for _, theirs in self._predictions():
            if not theirs.is_dir():
                raise InputError(theirs, "a folder of predictions", "nothing there")
        self.reading.check()
        check_folder(
            self.out,
            "figure",
            self.overwrite,
            (
                *self.data,
                *files_among(*self.weights, *self.scenes),
                *(theirs for _, theirs in self._predictions()),
                *self.protocol[1:],
                self.reading.images,
            ),
        )

    def _predictions(self) -> list[tuple[str, Path]]:
        """The name and folder of each of the other methods."""
        found = []
        for text in self.predictions:
            name, _, folder = text.partition("=")
            if not name or not folder:
                raise UsageError(f"--predictions is {text!r}; expected NAME=DIR")
            found.append((name, typed_path(folder)))
        return found

    def _weights(self, index: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The weights to show for one --data folder, and the headings of their columns."""
        if self.kind == "smoothness":
            _check_smoothness(self.weights)
            return self.weights, (WITHOUT, WITH)
        return (self.weights[index if len(self.weights) > 1 else 0],), ("ours",)

    def _part(self, index: int) -> FigurePart:
        """What the figure shows of one --data folder."""
        from paper.figure.compared_targets import FigurePart, choose_tasks
        from semgs.data.scene_lists import check_unseen
        from semgs.evaluation.frames.saved import SavedPredictions
        from semgs.evaluation.run import load_candidate, open_labelled_scenes, plan_targets
        from semgs.evaluation.tables.saved_report import data_name
        from semgs.model.weights.load import find, table_of, trained_scenes

        wanted_scenes = self.scenes[index] if self.scenes else ""
        data = open_labelled_scenes(self.data[index], self.reading.as_peers, self.reading.asked, wanted_scenes)
        scenes, classes = data.scenes, data.classes
        check_apart(self.out, (place for scene in scenes for place in scene.places))
        plan = plan_targets(self.protocol, scenes, (self.views,), self.size)
        wanted = [
            name
            for name in self.targets
            if len(self.data) == 1 or any(name.startswith(f"{one.name}/") for one in scenes)
        ]
        with what_the_user_gave():
            plan = replace(plan, tasks=choose_tasks(plan, self.rows, wanted))
        weights, names = self._weights(index)
        methods: list[Method] = []
        for name, folder in self._predictions():
            saved = SavedPredictions(folder, name)
            saved.check(plan)
            methods.append(saved)
        with what_the_user_gave():
            for one, name in zip(weights, names, strict=True):
                tested = [task.scene.name for task in plan.tasks]
                check_unseen(one, trained_scenes(one), tested, "show other rooms (--scenes, --targets)")
                classes = classes or table_of(find(one)[1])
                methods.append(load_candidate(one, classes, chosen_device(self.device), name).method)
        assert classes is not None
        title = self.names[index] if self.names else data_name(str(self.data[index]), [scene.name for scene in scenes])
        return FigurePart(title, plan, tuple(methods), classes)


def _check_smoothness(weights: Sequence[str]) -> None:
    """Refuse weights whose header says that the first were trained with the smoothness loss, or the second without."""
    from semgs.model.weights.load import find
    from semgs.model.weights.weights_file import is_ours, read_header

    for one, wanted in zip(weights, (False, True), strict=True):
        with what_the_user_gave():
            _, path = find(one)
        try:
            training = parse_json(read_header(path).metadata.get("training", "{}")) if is_ours(path) else {}
            weight = training.get("losses", {}).get("smoothness")
            smooth = None if weight is None else weight > 0
        except (ValueError, TypeError, AttributeError) as error:
            raise InputError(path, "training settings as JSON", str(error), key="training") from error
        if smooth not in (None, wanted):
            raise InputError(
                path, f"weights trained {'with' if wanted else 'without'} the smoothness loss", f"a smoothness weight of {weight:g}",
                key="training.losses.smoothness", advice="give the weights without it first",
            )  # fmt: skip


if __name__ == "__main__":
    sys.exit(run(PaperFigure, "figure"))
