"""`semgs segmenters fit`: learns on labelled scenes what a segmenter's classes mean."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from semgs.cli.options.scene_options import SceneOptions
from semgs.cli.options.types import AutoSize, Weights, optional
from semgs.cli.output_file import check_new_file
from semgs.cli.progress import show_progress, show_stage
from semgs.cli.usage_errors import UsageError, what_fits, what_the_user_gave
from semgs.data.spread import spread
from semgs.files.paths import existing_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semgs.data.scene import Scene
    from semgs.data.tables.classes import ClassTable
    from semgs.data.views import Views
    from semgs.model.semgs import SemGS
    from semgs.segmenters.class_source import ClassSource
    from semgs.segmenters.labelling import ClassVotes
    from semgs.segmenters.names import Correspondence

FRAMES = 4
"""Labelled frames of each scene, spread evenly."""


@dataclass(frozen=True)
class FitSegmenter:
    """Learn from labelled scenes what a segmenter's classes mean: how often each of its classes is each of ours.

    Use the result with --correspondence FILE of semgs reconstruct and semgs evaluate, instead of matching class names. With --weights, this
    also fits how much the segmenter and the network should each vote, class by class, for --with-own-classes.

    Examples
    - semgs rooms data/rooms --scenes 100 --frames 4
    - semgs segmenters fit segformer.onnx --data data/rooms --weights small --out segformer.fit.json
    """

    segmenter: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SEGMENTER")]
    """The segmenter, as for semgs reconstruct."""
    data: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """A labelled scene, or a folder of scenes."""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE")]
    """Output file (JSON)."""
    weights: Annotated[Weights, optional()] = ""
    """Also fit the votes of these weights: "small", a weights file, or hf://OWNER/NAME."""
    size: AutoSize = None
    """Height x width; by default at most 76,800 pixels."""
    reading: Annotated[SceneOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Fit, write the file, and print what was found.

        Raises:
            InputError: the segmenter, scenes or weights cannot be used.
            UsageError: an option is invalid.
        """
        existing_folder(self.data)
        self.reading.check()
        check_new_file(self.out)
        with show_stage("Starting"):
            from semgs.evaluation.run import open_labelled_scenes
            from semgs.segmenters.fitting import Fit, fit_correspondence, save_fit
            from semgs.segmenters.opening import open_class_sources

            data = open_labelled_scenes(self.data, self.reading.as_peers, self.reading.asked, needs_labels=True)
            scenes = [scene for scene in data.scenes if scene.classes is not None]
            opened = open_class_sources(self.segmenter, "own")
            assert data.classes is not None
            model = self._model(data.classes) if self.weights else None
        with show_progress("Segmenting", len(scenes)) as done:
            found = fit_correspondence(opened, scenes, self._read, done)
        votes = None if model is None else self._votes(model, opened, found, scenes)
        theirs = opened(scenes[0]).classes.names
        save_fit(self.out, Fit(opened(scenes[0]).title, theirs, found, votes))
        for name, row in zip(theirs, found.table, strict=True):
            best = sorted(range(len(row)), key=lambda label: -row[label])[:3]
            meaning = ", ".join(
                f"{found.classes.names[label]} {row[label]:.2f}" for label in best if row[label] >= 0.05
            )
            print(f"{name:<20} {meaning or 'never seen'}")
        print(f"\nWrote {self.out}.")

    def _read(self, scene: Scene) -> tuple[Sequence[int], Views]:
        """Some labelled frames of a scene."""
        positions = spread([place for place, frame in enumerate(scene.frames) if frame.labels is not None], FRAMES)
        return positions, scene.read(positions, self.size)

    def _model(self, classes: ClassTable) -> SemGS:
        """The network whose votes are fitted, with the classes of the scenes."""
        from semgs.model.weights.load import load

        with what_the_user_gave():
            model = load(self.weights, classes=classes).eval()
        if model.classes is None:
            raise UsageError(f"--weights {self.weights}: expected weights with classes")
        return model

    def _votes(
        self, model: SemGS, opened: Callable[[Scene], ClassSource], found: Correspondence, scenes: Sequence[Scene]
    ) -> ClassVotes:
        """Fit the votes."""
        from semgs.model.encode import encode
        from semgs.segmenters.class_source import Translated, read_distributions
        from semgs.segmenters.fitting import fit_votes, sample_pixels

        samples = []
        with what_fits(), show_progress("Fitting votes", len(scenes)) as done:
            for number, scene in enumerate(scenes, 1):
                positions, views = self._read(scene)
                said = read_distributions(Translated(opened(scene), found), scene, positions, views.size)
                own = encode(model, views).encoding.class_maps()
                samples.append(sample_pixels(views, said, own))
                done(number)
        return fit_votes(samples, len(found.classes))
