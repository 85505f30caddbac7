"""The paper's ablation. Trains its variants with the same steps and seeds, evaluates them and prints tables."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from paper.ablate.ablation_rooms import Drawn, draw_rooms
from paper.ablate.ablation_rows import (
    BASE_STAGES,
    ROWS,
    AblationRow,
    AblationStage,
    base_settings,
    row_settings,
    rows_of,
    semantic_row_settings,
)
from paper.ablate.training_runs import deadline, train_or_resume
from paper.program import run
from semgs.cli.options.training_options import ExecutionOptions, TypedSettings
from semgs.cli.progress import show_progress, show_stage
from semgs.files.errors import InputError
from semgs.files.paths import existing_folder
from semgs.run.options.types import Count, SeveralViews
from semgs.run.options.words import INLINE, Words, optional
from semgs.run.usage_errors import UsageError, what_fits, what_the_user_gave
from semgs.training.data.data_settings import ROOMS
from semgs.training.presets import PRESETS
from semgs.training.run.execution import Execution
from semgs.training.training_settings import WEIGHTS

if TYPE_CHECKING:
    from semgs.evaluation.frames.frame_plan import FramePlan
    from semgs.evaluation.run import LabelledScenes
    from semgs.evaluation.tables.saved_report import SavedReport
    from semgs.evaluation.tables.table_grid import Grid
    from semgs.training.training_settings import TrainingSettings

RUN, EVALUATION, BASE, TABLE, CURVES = "run", "evaluation", "base", "ablation.md", "curves.png"
VIEWS: dict[AblationStage, tuple[int, ...]] = {"whole": (4,), "semantic": (2, 3)}
"""Input views of the evaluation by default; the paper's table uses 4."""
TIMED_STEPS = 3
"""Steps that --dry-run times."""


@dataclass(frozen=True)
class Ablate:
    """Train and evaluate the variants of the paper's ablation, then print their tables with intervals.

    The first variant has none of the method's four parts; each further one adds a part: shared layers, windows, camera-aware attention,
    and the smoothness loss, which gives the full method. All use the same settings, steps and seeds. Name a preset, then the settings
    to change, as for semgs train.

    With --stage semantic, depth and colour are trained once, for three quarters of the steps, and then kept; each variant trains only its
    semantic branch, by the labels of its input views. Two more variants change the smoothness loss: to a sum, and to the strength of the
    cross-entropy.

    OUT will contain SEED/ROW/run and SEED/ROW/evaluation, as from semgs train and semgs evaluate, the generated rooms,
    the tables (ablation.md), and a plot of the validation's mIoU during training (curves.png, with matplotlib). To resume, repeat the command.

    Examples
    - python -m paper.ablate small_plain --out ablation --steps 3000 --dry-run
    - python -m paper.ablate small_plain --out ablation --steps 3000 --seeds 1 2
    - python -m paper.ablate small_plain --stage semantic --out ablation --steps 4000 --size 120x160 --seeds 1 2 3
    - python -m paper.ablate paper --out ablation --data scannet/train --init re10k.ckpt --test scans --test-scenes scannet-sray-test --protocol peers
    """

    presets: ClassVar = PRESETS

    only_with: ClassVar = {"--test": ("--test-scenes",), "--stage whole": ("--full",)}

    settings: Annotated[TypedSettings, INLINE]
    out: Annotated[Path, Words(metavar="DIR")]
    """Output folder: new, empty, or one with the same settings to resume."""
    stage: AblationStage = "whole"
    """whole: train every variant from its first step. semantic: only its semantic branch, on the same depth and colour; far cheaper."""
    rooms: Count = 1600
    """With --stage semantic: rooms to train on, generated once for all variants, without --data."""
    test: Annotated[Path | None, optional("DIR")] = None
    """Scenes to evaluate on, at the training size. By default, 48 generated rooms that training never sees, and with --stage semantic also 48
    rooms in another style."""
    test_scenes: Annotated[str, optional("LIST")] = ""
    """Only evaluate on the scenes of a list: an included one (scannet-sray-test), or a text file with one name per line."""
    transfer: Annotated[tuple[Path, ...], optional("DIR [DIR ...]")] = ()
    """Scenes of other worlds to evaluate on as well."""
    protocol: Literal["neighbours", "peers"] = "neighbours"
    """Which frames to evaluate, as for semgs evaluate."""
    views: Annotated[SeveralViews, optional()] = ()
    """Input views in the evaluation; by default 4, as in the paper's table, and 2 and 3 with --stage semantic."""
    seeds: Annotated[tuple[int, ...], optional("SEED [SEED ...]")] = ()
    """Train all variants once per seed; by default, once with the seed of the settings."""
    rows: Annotated[tuple[str, ...], optional("ROW [ROW ...]")] = ()
    """Only train and evaluate these variants, named as their folders; by default all. Processes can share the work: with --stage semantic,
    first train depth and colour (--rows base), then the variants side by side, each by a command of its own with the same OUT."""
    full: Annotated[Path | None, optional("RUN")] = None
    """A finished semgs train run of the full method with these settings. It is evaluated but not trained again."""
    train_only: bool = False
    """Evaluate nothing. To evaluate, repeat the command without this, also on another machine with a copy of OUT."""
    dry_run: bool = False
    """Print what would be trained and estimate the time from three steps of the full method; write nothing."""
    compute: Annotated[ExecutionOptions, INLINE] = field(default_factory=ExecutionOptions)

    def run(self) -> None:
        """Train and evaluate what is missing, and print the tables.

        Raises:
            InputError: the folder or the evaluation data cannot be used.
            UsageError: the settings are invalid, or a training failed.
        """
        self._check()
        with what_the_user_gave():
            runs = [(row, seed) for seed in self.seeds or (self.settings.seed,) for row in self._rows()]
            planned = [self._settings(row, seed) for row, seed in runs]
            for stage in BASE_STAGES if self.stage == "semantic" else ():
                base_settings(self._shared(), stage, None)  # refused before anything is trained
        self._check_unseen()
        if self.full is not None:
            self._check_full(self.full, planned[-1])
        execution = self.compute.execution()
        with what_the_user_gave():
            execution.share().check(self.settings.batch)
        if self.dry_run:
            print(self._cost(len(runs), execution))
            return
        ends = deadline(self.compute.minutes)
        if self.stage == "semantic" and not self._train_base(execution, ends):
            print("stopped: depth and colour are not finished; repeat the command to resume")
            return
        if not runs:
            return
        tests = {} if self.train_only else self._tests()
        targets, truths, done = cache(self._targets), cache(_read_truths), []
        for number, ((row, seed), settings) in enumerate(zip(runs, planned, strict=True), 1):
            title = f"{number}/{len(runs)} {row.title}, seed {seed}"
            if not self._train(title, row, settings, execution, ends):
                print(f"stopped: run {number} of {len(runs)} is not finished; repeat the command to resume")
                break
            for name, path in tests.items():
                self._evaluate(row, settings, execution.device, name, *targets(path), truths)
            done.append((row, seed))
        if not self.train_only:
            tested = {name: targets(path) for name, path in tests.items()} if done else {}
            print(self._tables(done, tested))

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        for folder in (*((self.test,) if self.test else ()), *self.transfer):
            existing_folder(folder)
        names = [folder.absolute().name for folder in self.transfer]
        if len(set(names)) != len(names) or {"other"} & set(names):
            raise UsageError("--transfer needs folders of different names, none of them other")
        if self.full is not None and self.rows and "full" not in self.rows:
            raise UsageError("--full gives the variant full, which --rows leaves out")
        if self.full is not None and len(self.seeds) > 1:
            raise UsageError("--full is a single run, so give at most one seed with --seeds")
        if len(set(self.seeds)) != len(self.seeds):
            raise UsageError("--seeds contains a seed twice")
        known = [*([BASE] if self.stage == "semantic" else []), *(row.name for row in rows_of(self.stage))]
        if unknown := [name for name in self.rows if name not in known]:
            raise UsageError(f"--rows {unknown[0]}: --stage {self.stage} has {', '.join(known)}")
        if self.out.exists() and not self.out.is_dir():
            raise InputError(self.out, "a folder to write", "a file", advice="name another")

    def _check_unseen(self) -> None:
        """Refuse, before anything is trained, to train on rooms that are also used for evaluation."""
        from semgs.data.scene_lists import check_unseen, read_list, scenes_by_name
        from semgs.data.scenes import scene_paths
        from semgs.training.data.data_check.open_sources import training_paths

        if self.test is None and not self.transfer:
            return
        trained = [
            name for source, paths in training_paths(self.settings) for name in scenes_by_name(Path(source.path), paths)
        ]
        for folder in (*((self.test,) if self.test else ()), *self.transfer):
            wanted = read_list(self.test_scenes) if self.test_scenes and folder == self.test else None
            tested = scenes_by_name(folder, scene_paths(folder, wanted))
            check_unseen(folder, trained, tested, "train without these (--scenes), or evaluate on others")

    def _check_full(self, full: Path, settings: TrainingSettings) -> None:
        """Refuse --full if that run has other settings or is not finished."""
        from semgs.training.run.run_folder import is_finished, read_settings
        from semgs.training.training_settings import find_changes, list_changes

        if other := find_changes(settings, read_settings(full)):
            raise UsageError(f"--full {full} has other settings: {list_changes(other, 'here')}")
        if not is_finished(full):
            raise UsageError(f"--full {full} is not finished; repeat its semgs train command first")

    def _rows(self) -> tuple[AblationRow, ...]:
        """The variants that the user wants, in order."""
        return tuple(row for row in rows_of(self.stage) if row.name in self.rows or not self.rows)

    def _settings(self, row: AblationRow, seed: int) -> TrainingSettings:
        """The settings of a variant."""
        if self.stage == "whole":
            return row_settings(self.settings, row, seed)
        return semantic_row_settings(self._shared(), row, seed, self._base_weights(BASE_STAGES[-1]))

    def _shared(self) -> TrainingSettings:
        """The settings that all trainings of a semantic ablation share: those given, with the same rooms for all."""
        drawn = self.settings.data == (ROOMS,)
        return replace(self.settings, data=(str(self._room_sets()["training"].folder),)) if drawn else self.settings

    def _room_sets(self) -> dict[str, Drawn]:
        """The rooms that are drawn if they are needed, by what they are for."""
        return {
            "training": Drawn(self.out / "rooms_training", "home", "training", self.rooms),
            "test": Drawn(self.out / "rooms", "home", "validation"),
            "other": Drawn(self.out / "rooms_other", "other", "other"),
        }

    def _tests(self) -> dict[str, Path]:
        """What to evaluate on, by the name of the folder of its evaluations; rooms are drawn if they are missing."""

        def drawn(name: str) -> Path:
            return draw_rooms(self._room_sets()[name], self.settings, self.compute.workers)

        found = {EVALUATION: drawn("test") if self.test is None else self.test}
        if self.stage == "semantic" and self.test is None:
            found[f"{EVALUATION}_other"] = drawn("other")
        return found | {f"{EVALUATION}_{folder.absolute().name}": folder for folder in self.transfer}

    def _base(self, stage: str) -> Path:
        """The run folder of a training of the base."""
        return self.out / BASE / stage

    def _base_weights(self, stage: str) -> Path:
        """The weights that a finished training of the base leaves."""
        return self._base(stage) / WEIGHTS

    def _train_base(self, execution: Execution, ends: float | None) -> bool:
        """Train depth, then colour, for all variants. Returns whether they are finished."""
        if self.settings.data == (ROOMS,):
            draw_rooms(self._room_sets()["training"], self.settings, self.compute.workers)
        before: Path | None = None
        for stage in BASE_STAGES:
            settings = base_settings(self._shared(), stage, before)
            self._check_base(self._base(stage), settings.steps)
            if not train_or_resume(f"Base: {stage}", self._base(stage), settings, execution, ends):
                return False
            before = self._base_weights(stage)
        return True

    def _check_base(self, run: Path, steps: int) -> None:
        """Refuse to train the base for longer: variants have started from it."""
        from semgs.training.run.run_folder import has_begun, read_settings

        if has_begun(run) and (there := read_settings(run).steps) < steps:
            raise UsageError(
                f"--steps: {run} has {there} steps, not {steps}, and the variants start from it; name another --out"
            )

    def _folder(self, row: AblationRow, seed: int) -> Path:
        return self.out / f"seed_{seed}" / row.name

    def _run(self, row: AblationRow, seed: int) -> Path:
        """The run folder of a variant."""
        return self.full if self.full is not None and row.name == "full" else self._folder(row, seed) / RUN

    def _train(
        self, title: str, row: AblationRow, settings: TrainingSettings, execution: Execution, ends: float | None
    ) -> bool:
        """Train a variant, or resume its training. Returns whether it is finished."""
        run = self._run(row, settings.seed)
        if run == self.full:
            return True
        return train_or_resume(title, run, settings, execution, ends)

    def _targets(self, path: Path) -> tuple[LabelledScenes, FramePlan]:
        """Scenes to evaluate on, and their targets."""
        from semgs.evaluation.run import open_labelled_scenes, plan_targets

        with show_stage("Reading scenes"):
            data = open_labelled_scenes(path, wanted=self.test_scenes if path == self.test else "", needs_labels=True)
        return data, plan_targets((self.protocol,), data.scenes, self._views(), self.settings.size)

    def _evaluate(
        self,
        row: AblationRow,
        settings: TrainingSettings,
        device: str,
        name: str,
        data: LabelledScenes,
        plan: FramePlan,
        truths: Callable[[FramePlan], dict[int, str]],
    ) -> None:
        """Evaluate a trained variant on some scenes, unless that was done before with the same weights, labels and depths."""
        from semgs.evaluation.run import Job, load_candidate, run_evaluation
        from semgs.files.contents import sha256

        folder = self._folder(row, settings.seed) / name
        weights = self._run(row, settings.seed) / WEIGHTS
        if folder.exists():
            report = _report(folder, data, plan)
            known = {views: result.truth for views, result in report.results.items()}
            if report.sha256 == sha256(weights) and known == truths(plan):
                return
        with what_the_user_gave():
            candidate = load_candidate(weights, data.classes, device, row.title)
        with what_fits(), show_progress(f"Evaluating {row.title} on {data.path.name}", len(plan.tasks)) as done:
            run_evaluation(folder, Job(data, plan, candidate), overwrite=folder.exists(), done=done)

    def _views(self) -> tuple[int, ...]:
        """The numbers of input views in the evaluation."""
        return self.views or VIEWS[self.stage]

    def _tables(self, runs: list[tuple[AblationRow, int]], tests: dict[str, tuple[LabelledScenes, FramePlan]]) -> str:
        """The tables of evaluated runs; they are also written to OUT.

        Args:
            runs: the trainings, each of which was evaluated.
            tests: what they were evaluated on, by the name of the folder of its evaluations.
        """
        from semgs.evaluation.tables.table_grid import printed
        from semgs.files.atomic import write_text

        texts: dict[Literal["text", "markdown"], list[str]] = {"text": [], "markdown": []}
        for name, (data, plan) in tests.items():
            reports = self._reports(runs, name, data, plan)
            for form, blocks in texts.items():
                heading = f"{'## ' if form == 'markdown' else ''}Evaluated on {data.path.name}"
                blocks += [heading, *(printed(grid, form) for grid in self._grids(reports, plan))]
        if not texts["text"]:
            return "no run has been evaluated yet"
        write_text(self.out / TABLE, "\n\n".join(texts["markdown"]) + "\n")
        self._draw_curves(runs)
        return "\n\n".join([*texts["text"], f"The same in Markdown: {self.out / TABLE}"])

    def _draw_curves(self, runs: list[tuple[AblationRow, int]]) -> None:
        """Draw how the variants learned, if they were validated and matplotlib is installed."""
        from paper.ablate.validation_plot import validation_picture
        from semgs.figures.plotting import can_plot
        from semgs.files.images.pictures import write_png
        from semgs.training.run.log import read_validations

        found = {
            row.title: [
                curve
                for other, seed in runs
                if other is row and (curve := read_validations(self._run(row, seed), "miou"))
            ]
            for row in self._rows()
        }
        if can_plot() and any(found.values()):
            write_png(self.out / CURVES, validation_picture(found, "mIoU"))

    def _reports(
        self, runs: list[tuple[AblationRow, int]], name: str, data: LabelledScenes, plan: FramePlan
    ) -> dict[tuple[str, int], SavedReport]:
        """The reports of runs on some scenes."""
        from paper.ablate.ablation_tables import read_fragments
        from semgs.evaluation.tables.comparison_tables import check_comparable

        found = {(row.name, seed): _report(self._folder(row, seed) / name, data, plan) for row, seed in runs}
        check_comparable(list(found.values()))
        return {run: read_fragments(report) for run, report in found.items()}

    def _grids(self, reports: dict[tuple[str, int], SavedReport], plan: FramePlan) -> list[Grid]:
        """The tables of the reports of some scenes."""
        from paper.ablate.ablation_tables import ablation_grid, steps_grid, where_grid
        from paper.ablate.view_relations import view_relations

        grids, rows = [], self._rows()
        for views in self._views():
            relations = view_relations(plan, views)
            grids += [
                ablation_grid(rows, reports, views),
                steps_grid(rows, reports, views),
                where_grid(rows, reports, views, relations),
            ]
        return grids

    def _cost(self, runs: int, execution: Execution) -> str:
        """What would be trained, and an estimate of the time from three steps of each kind of training."""
        full: TrainingSettings = self.settings
        kinds = [("variant", runs, full)]
        if self.stage == "semantic":
            row = semantic_row_settings(full, ROWS[-1], full.seed, Path())
            base = [(f"base: {stage}", 1, base_settings(full, stage, None)) for stage in BASE_STAGES]
            kinds = [*base, ("variant", runs, replace(row, init=full.init, semantic_branch="kept"))]
        height, width = full.size
        lines, hours = [], 0.0
        with show_stage("Timing three steps of each kind of training"), what_the_user_gave():
            for kind, count, settings in kinds:
                seconds = _seconds_a_step(settings, execution)
                hours += count * settings.steps * seconds / 3600
                lines.append(
                    f"{kind}: {count} x {settings.steps} steps of {settings.batch} scenes at {height}x{width}, about {seconds:.2f} s per step on "
                    f"this machine, {settings.steps * seconds / 60:.0f} min each"
                )
        counts = " and ".join(map(str, self._views()))
        return "\n".join(
            [
                *lines,
                f"then {runs} evaluations with {counts} views",
                f"about {hours:.1f} h in total, not counting evaluation, validation and the drawing of rooms",
            ]
        )


def _read_truths(plan: FramePlan) -> dict[int, str]:
    """The hashes of the true labels and depths as they are now, by number of views."""
    from semgs.evaluation.scoring.method_scores import hash_truths

    with show_stage("Reading labels"):
        return hash_truths(plan)


def _report(folder: Path, data: LabelledScenes, plan: FramePlan) -> SavedReport:
    """The report of an evaluation.

    Raises:
        InputError: the folder is no evaluation of these targets.
    """
    from semgs.evaluation.frames.frame_plan import frame_list
    from semgs.evaluation.tables.saved_report import data_name, read_report
    from semgs.files.strict_json import read_json

    report = read_report(folder)
    same_data = report.data_name == data_name(str(data.path), [scene.name for scene in data.scenes])
    if not same_data or read_json(folder / "frames.json") != frame_list(plan):
        raise InputError(
            folder, f"an evaluation of these frames of {data.path.name}", f"one of other frames, or of {report.data_name}",
            advice="choose another --out",
        )  # fmt: skip
    return report


def _seconds_a_step(settings: TrainingSettings, execution: Execution) -> float:
    """Seconds that one process takes for its part of a step, the mean of three after a training that warms up."""
    from tempfile import TemporaryDirectory

    from semgs.training.loop import train
    from semgs.training.run.run_folder import newest_checkpoint

    processes = execution.devices * execution.nodes
    short = replace(settings, steps=TIMED_STEPS, validation_scenes=0, scene_reuse=1, batch=settings.batch // processes)
    alone = replace(execution, workers=0, minutes=None, devices=1, nodes=1)
    with TemporaryDirectory() as folder:
        train(replace(short, steps=1), Path(folder) / "warm", alone)
        train(short, Path(folder) / "timed", alone)
        checkpoint = newest_checkpoint(Path(folder) / "timed" / "checkpoints")
    return 0.0 if checkpoint is None else checkpoint.numbers["seconds"] / TIMED_STEPS


if __name__ == "__main__":
    sys.exit(run(Ablate, "ablate"))
