"""`semgs weights calibrate`: fits temperatures on labelled scenes and writes them into the header of the weights."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from semgs.cli.progress import show_progress, show_stage
from semgs.figures.plotting import check_plotting
from semgs.files.errors import InputError
from semgs.files.folders import check_new_file
from semgs.files.paths import existing_folder
from semgs.run.options.scene_options import SceneOptions
from semgs.run.options.types import AutoSize, Protocol, Views, Weights
from semgs.run.options.words import INLINE, Words, optional, positional
from semgs.run.usage_errors import what_fits, what_the_user_gave

if TYPE_CHECKING:
    from collections.abc import Mapping

    from semgs.evaluation.scoring.confidence_calibration import TemperatureEffect
    from semgs.evaluation.tables.table_grid import Grid


@dataclass(frozen=True)
class Calibrate:
    """Calibrate confidence on labelled scenes, and save the result in the header of the weights.

    This fits two temperatures: one for rendered pixels, one for single Gaussians. They change how confident the network is, never which
    class wins, so class maps and scores stay the same. semgs reconstruct uses them, and so does whatever reads its output;
    semgs.tempered(distributions, temperature) applies one.

    Without --out, nothing is fitted; the existing temperatures are measured on these scenes. The output is the expected calibration error
    before and after.

    Scenes that WEIGHTS were trained on are refused. Generated rooms cannot be recognised, because weights do not list every seed: use
    style other, which is never trained on, or a seed of your own.

    Examples
    - semgs weights calibrate runs/mine/weights.safetensors --data rooms/other --out mine.safetensors --plot reliability.png
    - semgs weights calibrate small --data scans
    """

    weights: Annotated[Weights, positional("WEIGHTS")]
    """"small" for the included weights, a weights file, or hf://OWNER/NAME on the hub."""
    data: Annotated[Path, Words(metavar="DIR")]
    """A labelled scene, or a folder of scenes."""
    out: Annotated[Path | None, optional("FILE")] = None
    """Output file: the same tensors, with the temperatures in the header."""
    plot: Annotated[Path | None, optional("PNG")] = None
    """Write a reliability plot."""
    protocol: Protocol = ("neighbours",)
    """Which frames, as for semgs evaluate: neighbours, peers, or pinned FILE."""
    views: Views = 2
    """Number of input views."""
    size: AutoSize = None
    """Height x width; by default 240x320, 320x240 for portrait scenes."""
    reading: Annotated[SceneOptions, INLINE] = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Fit or measure, write, and print a table.

        Raises:
            InputError: weights, scenes or files cannot be used.
            UsageError: an option is invalid.
        """
        self._check()
        with show_stage("Starting"):
            from semgs.data.scene_lists import check_unseen
            from semgs.evaluation.run import open_labelled_scenes, plan_targets
            from semgs.evaluation.scoring.confidence_calibration import KINDS, collect_statements, measure_temperature
            from semgs.evaluation.tables.table_grid import printed
            from semgs.files.atomic import write_bytes
            from semgs.model.weights.header import TEMPERATURES as KEY
            from semgs.model.weights.header import temperatures_text
            from semgs.model.weights.load import find, load, trained_scenes
            from semgs.model.weights.weights_file import is_ours, read_header, read_temperatures, restate
            from semgs.rendering.temperatures import Temperatures

            data = open_labelled_scenes(self.data, self.reading.as_peers, self.reading.asked, needs_labels=True)
            assert data.classes is not None
            with what_the_user_gave():
                network, path = find(self.weights)
            if not is_ours(path) or read_header(path).classes is None:
                other = "colour-only weights" if is_ours(path) else "another file"
                raise InputError(path, "weights of semgs with classes", other)
            plan = plan_targets(self.protocol, data.scenes, (self.views,), self.size)
            tested = [scene.name for scene in plan.scenes]
            check_unseen(self.weights, trained_scenes(path), tested, "use other scenes (--data)")
            held = read_temperatures(path)
            if self.out is None and held is None:
                raise InputError(path, "temperatures to measure", "none", key=KEY, advice="fit them: --out FILE")
            model = load(network, path, classes=data.classes)
        with what_fits(), show_progress("Reconstructing", len(plan.tasks)) as done:
            said = collect_statements(plan, model, done=done)
        if not all(len(said[kind].labels) for kind in KINDS):
            raise InputError(self.data, "labels in input views and target views", "only unlabelled ones")
        known = held if self.out is None else None
        found = {kind: measure_temperature(said[kind], getattr(known, kind) if known else None) for kind in KINDS}
        if self.plot is not None:
            write_bytes(self.plot, _plot(found))
        if self.out is not None:
            fitted = Temperatures(**{kind: one.temperature for kind, one in found.items()})
            restate(path, self.out, {KEY: temperatures_text(fitted)})
        print(printed(_grid(found, f"{len(plan.tasks)} targets of {self.data}"), "text"))

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        existing_folder(self.data)
        if self.plot is not None:
            check_plotting()
        self.reading.check()
        for file in (self.out, self.plot):
            if file is not None:
                check_new_file(file)


def _grid(found: Mapping[str, TemperatureEffect], data: str) -> Grid:
    """The table of temperatures and calibration errors."""
    from semgs.evaluation.tables.table_grid import Cell, Grid

    rows = tuple(
        tuple(map(Cell, (kind, f"{one.temperature:.3f}", f"{one.error_before:.3f}", f"{one.error_after:.3f}")))
        for kind, one in found.items()
    )
    return Grid(f"Calibration, {data}", ("", "temperature", "ECE before", "ECE after"), rows)


def _plot(found: Mapping[str, TemperatureEffect]) -> bytes:
    """The reliability plot of each kind."""
    from semgs.figures.plotting import ReliabilityPlot, reliability_png

    plots = []
    for kind, effect in found.items():
        before = ("before", tuple(map(astuple, effect.bins_before)))
        after = (f"temperature {effect.temperature:.2f}", tuple(map(astuple, effect.bins_after)))
        plots.append(ReliabilityPlot(kind, (before, after)))
    return reliability_png(plots)
