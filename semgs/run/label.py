"""`semgs label`: prepared scenes whose labels are a segmenter's answers."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from semgs._version import __version__
from semgs.files.paths import existing_folder
from semgs.run.options.scene_options import SceneOptions
from semgs.run.options.segmenter_options import AnswerOptions
from semgs.run.options.types import Count, Probability, Size
from semgs.run.options.words import INLINE, LAST_WORD, Words, optional, positional
from semgs.run.outcome import Outcome, Run
from semgs.run.prepare import prepared
from semgs.runtime.notes import Progress


@dataclass(frozen=True)
class Label(Run):
    """Label scenes with a 2D segmenter, to train a network on its answers.

    SRC and OUT are as for semgs prepare: each scene becomes OUT/NAME.zip, but its labels are the segmenter's. Pixels of which the
    segmenter is not sure get no label (255). Depth is kept. The segmenter's name and licence are written into the scenes, and
    into all weights that are trained on them.

    SEGMENTER is a folder of class maps, an exported network (.onnx, .tflite), a model folder of transformers, or hf:OWNER/NAME; see
    docs/segmenters.md. A folder of class maps contains the maps of scene NAME in SEGMENTER/NAME/; for a single scene they may also
    be in SEGMENTER itself. classes.json is in SEGMENTER, or in the folder of each scene.

    OUT/classes.json is the table of classes, if these are not ScanNet's. To resume, repeat the command. If the maps have changed,
    delete OUT first.

    Examples
    - semgs label scans --out data/taught --segmenter segformer.onnx
    - semgs train small --init small --data data/taught --out runs/student
    - semgs label scans --out data/own --segmenter maps --classes own --confidence 0.7
    """

    src: Annotated[Path, positional("SRC")]
    """A scene, or a folder of scenes."""
    out: Annotated[Path, Words(metavar="OUT"), LAST_WORD]
    """Output folder: new, empty, or one with the same settings to resume."""
    segmenter: Annotated[str, Words(metavar="SEGMENTER")]
    """What labels the photos."""
    answers: Annotated[AnswerOptions, INLINE] = field(default_factory=AnswerOptions)
    confidence: Probability = 0.5
    """Pixels get no label if no class is this likely, from 0 to 1."""
    size: Size = (240, 320)
    """Height x width of the images, in pixels; swapped for portrait images. Other aspect ratios are centre-cropped."""
    every: Count = 1
    """Keep each n-th frame."""
    scenes: Annotated[str, optional("LIST")] = ""
    """Only the scenes of a list, as for semgs prepare."""
    reading: Annotated[SceneOptions, INLINE] = field(default_factory=SceneOptions)

    def run(self, progress: Progress) -> Outcome:
        """Label the scenes.

        Raises:
            InputError: SRC contains no scene, OUT contains something else, the segmenter cannot be used, or no scene could be labelled.
            UsageError: an option is invalid, OUT has other settings, or there is not enough space.
            ImportError: the library that runs the segmenter is not installed.
            OSError: the disk is full.
        """
        self.reading.check()
        self.answers.check()
        existing_folder(self.src)
        with progress.stage("Opening the segmenter"):
            from semgs.data.preparation.archive import Preparation
            from semgs.data.preparation.prepared_set import Reading, find_sources
            from semgs.data.scene_lists import read_list
            from semgs.data.scenes import open_scene
            from semgs.data.tables.class_files import class_file
            from semgs.data.tables.classes import SCANNET20
            from semgs.files.atomic import write_json
            from semgs.segmenters.class_map_files import TABLE
            from semgs.segmenters.class_source import notes_of
            from semgs.segmenters.relabelling import open_relabelling

            found = find_sources(self.src, read_list(self.scenes) if self.scenes else None)
            reading = Reading(self.reading.as_peers, self.reading.asked, needs_labels=False)
            labelled = open_relabelling(
                self.segmenter, reading, self.answers.classes, self.confidence,
                correspondence=self.answers.correspondence, words=self.answers.words, alone=len(found) == 1,
            )  # fmt: skip
        # Networks use all cores by themselves, so there are no worker processes.
        settings = Preparation(self.size, self.every, version=__version__)
        index, lines = prepared(self.out, found, settings, labelled, 0, progress)
        first = index["scenes"][0]
        scene = next(labelled.reading.open(one) for one in found if one.name == first["name"])
        pixels = index["pixels"]
        share = 1 - pixels["ignored"] / max(1, sum(pixels.values()))
        notes = (
            *notes_of(labelled.source_of(scene)),
            f"{share:.1%} of the pixels have a label: one class is at least {self.confidence:.0%} likely",
        )
        table = open_scene(self.out / first["file"]).classes
        own = ""
        if table is not None and table != SCANNET20:
            write_json(self.out / TABLE, class_file(table))
            own = f" --classes {self.out / TABLE}"
        further = f"To learn from them: semgs train small --init small --data {self.out}{own} --out RUN"
        return Outcome((*lines, *notes, further), notes)
