"""`semgs ablate`: the paper's ablation. Trains five variants with the same steps and seeds, evaluates them and prints a table."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from semgs.cli.commands.networks.training_runs import deadline, train_or_resume
from semgs.cli.options.execution_options import ExecutionOptions
from semgs.cli.options.training_options import PresetSettings
from semgs.cli.options.types import Views
from semgs.cli.progress import show_progress, show_stage
from semgs.cli.usage_errors import UsageError, what_fits, what_the_user_gave
from semgs.files.errors import InputError
from semgs.files.paths import existing_folder
from semgs.training.run.execution import Execution

if TYPE_CHECKING:
    from semgs.evaluation.tables.ablation import AblationRow
    from semgs.evaluation.tables.evaluation_report import SavedReport
    from semgs.training.training_settings import TrainingSettings

RUN, EVALUATION, ROOMS, TABLE = "run", "evaluation", "rooms", "ablation.md"
SCENES = 24
"""Rooms that are generated for evaluation if --test is not given."""
TIMED_STEPS = 3
"""Steps that --dry-run times."""


@tyro.conf.configure(tyro.conf.CascadeSubcommandArgs, tyro.conf.OmitSubcommandPrefixes)
@dataclass(frozen=True)
class Ablate:
    """Train and evaluate the five variants of the paper's ablation, then print their table with intervals.

    The first variant has none of the method's four parts; each further one adds a part: shared layers, windows, camera-aware attention,
    and the smoothness loss, which gives the full method. All use the same settings, steps and seeds. Name a preset, then the settings
    to change, as for semgs train.

    OUT will contain SEED/ROW/run and SEED/ROW/evaluation, as from semgs train and semgs evaluate, rooms/ to evaluate on (without --test),
    and ablation.md, the table. To resume, repeat the command.

    Examples
    - semgs ablate small_plain --out ablation --steps 3000 --dry-run
    - semgs ablate small_plain --out ablation --steps 3000 --seeds 1 2
    - semgs ablate paper --out ablation --data scannet/train --init re10k.ckpt --test scans --test-scenes scannet-sray-test --protocol peers
    """

    settings: Annotated[PresetSettings, tyro.conf.arg(name="")]
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Output folder: new, empty, or one with the same settings to resume."""
    test: Annotated[Path | None, tyro.conf.arg(metavar="DIR", help_behavior_hint="")] = None
    """Scenes to evaluate on, at the training size. By default, 24 generated rooms that training never sees."""
    test_scenes: Annotated[str, tyro.conf.arg(metavar="LIST", help_behavior_hint="")] = ""
    """Only evaluate on the scenes of a list: an included one (scannet-sray-test), or a text file with one name per line."""
    protocol: Literal["neighbours", "peers"] = "neighbours"
    """Which frames to evaluate, as for semgs evaluate."""
    views: Views = 4
    """Input views in the evaluation; the paper's table uses 4."""
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(metavar="SEED [SEED ...]", help_behavior_hint="")] = ()
    """Train all five variants once per seed; by default, once with the seed of the settings."""
    full: Annotated[Path | None, tyro.conf.arg(metavar="RUN", help_behavior_hint="")] = None
    """A finished semgs train run of the full method with these settings. It is evaluated but not trained again."""
    dry_run: bool = False
    """Print what would be trained and estimate the time from three steps of the full method; write nothing."""
    compute: Annotated[ExecutionOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=ExecutionOptions)

    def run(self) -> None:
        """Train and evaluate what is missing, and print the table.

        Raises:
            InputError: the folder or the evaluation data cannot be used.
            UsageError: the settings are invalid, or a training failed.
        """
        self._check()
        from semgs.evaluation.tables.ablation import ROWS, row_settings

        with what_the_user_gave():
            runs = [
                (row, row_settings(self.settings, row, seed))
                for seed in self.seeds or (self.settings.seed,)
                for row in ROWS
            ]
        self._check_unseen()
        self._check_full(runs[-1][1])
        execution = self.compute.execution()
        with what_the_user_gave():
            execution.share().check(self.settings.batch)
        if self.dry_run:
            print(self._cost(len(runs), execution.device))
            return
        ends = deadline(self.compute.minutes)
        for number, (row, settings) in enumerate(runs, 1):
            title = f"{number}/{len(runs)} {row.title}, seed {settings.seed}"
            if not self._train(title, row, settings, execution, ends):
                print(f"time is up: run {number} of {len(runs)} is not finished; repeat the command to resume")
                break
            self._evaluate(row, settings, execution.device)
        print(self._table([(row, settings.seed) for row, settings in runs]))

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        if self.test is not None:
            existing_folder(self.test)
        elif self.test_scenes:
            raise UsageError("--test-scenes is for --test DIR")
        if self.full is not None and len(self.seeds) > 1:
            raise UsageError("--full is a single run, so give at most one seed with --seeds")
        if len(set(self.seeds)) != len(self.seeds):
            raise UsageError("--seeds contains a seed twice")
        if self.out.exists() and not self.out.is_dir():
            raise InputError(self.out, "a folder to write", "a file", advice="name another")

    def _check_unseen(self) -> None:
        """Refuse, before anything is trained, to train on rooms that are also used for evaluation."""
        from semgs.data.scene_lists import check_unseen, read_list, scenes_by_name
        from semgs.data.scenes import scene_paths
        from semgs.training.data.data_check.open_sources import training_paths

        if self.test is None:
            return
        trained = [
            name for source, paths in training_paths(self.settings) for name in scenes_by_name(Path(source.path), paths)
        ]
        wanted = read_list(self.test_scenes) if self.test_scenes else None
        tested = scenes_by_name(self.test, scene_paths(self.test, wanted))
        check_unseen(self.test, trained, tested, "train without these (--scenes), or evaluate on others")

    def _check_full(self, settings: TrainingSettings) -> None:
        """Refuse --full if that run has other settings or is not finished."""
        if self.full is None:
            return
        from semgs.training.run.differences import find_changes, list_changes
        from semgs.training.run.run_folder import is_finished, read_settings

        if other := find_changes(settings, read_settings(self.full)):
            raise UsageError(f"--full {self.full} has other settings: {list_changes(other, 'here')}")
        if not is_finished(self.full):
            raise UsageError(f"--full {self.full} is not finished; repeat its semgs train command first")

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

    def _evaluate(self, row: AblationRow, settings: TrainingSettings, device: str) -> None:
        """Evaluate a trained variant, unless that was done before."""
        from semgs.evaluation.run import Job, load_candidate, open_labelled_scenes, plan_targets, run_evaluation
        from semgs.training.run.run_folder import WEIGHTS

        folder = self._folder(row, settings.seed)
        if (folder / EVALUATION).exists():
            return
        path = self._rooms(settings) if self.test is None else self.test
        with show_stage("Reading scenes"):
            data = open_labelled_scenes(path, wanted=self.test_scenes, needs_labels=True)
        plan = plan_targets((self.protocol,), data.scenes, (self.views,), settings.size)
        weights = self._run(row, settings.seed) / WEIGHTS
        with what_the_user_gave():
            candidate = load_candidate(weights, data.classes, device, row.title)
        with what_fits(), show_progress(f"Evaluating {row.title}", len(plan.tasks)) as done:
            run_evaluation(folder / EVALUATION, Job(data, plan, candidate), done=done)

    def _rooms(self, settings: TrainingSettings) -> Path:
        """Rooms to evaluate on; they are generated if they do not exist yet."""
        from semgs.rooms.assets.asset_library import Library
        from semgs.rooms.sets.dataset import RoomSettings, write_dataset
        from semgs.training.data.data_settings import VALIDATION_SEED

        library = Library(settings.assets, "validation", check=False) if settings.assets else None
        rooms = RoomSettings(VALIDATION_SEED, settings.size, library=library)
        with what_the_user_gave(), show_progress("Generating rooms", SCENES) as done:
            write_dataset(self.out / ROOMS, rooms, SCENES, workers=self.compute.workers, done=done)
        return self.out / ROOMS

    def _table(self, runs: list[tuple[AblationRow, int]]) -> str:
        """The table of all evaluated runs; it is also written to OUT."""
        from semgs.evaluation.tables.ablation import ablation_grid, steps_grid
        from semgs.evaluation.tables.comparison_tables import check_comparable
        from semgs.evaluation.tables.evaluation_report import read_report
        from semgs.evaluation.tables.table_grid import printed
        from semgs.files.atomic import write_text

        reports: dict[tuple[str, int], SavedReport] = {}
        for row, seed in runs:
            folder = self._folder(row, seed) / EVALUATION
            if folder.exists():
                reports[row.name, seed] = read_report(folder)
        if not reports:
            return "no run has been evaluated yet"
        missing = next((one.path for one in reports.values() if self.views not in one.results), None)
        if missing is not None:
            raise InputError(missing, f"results for {self.views} views", "none", advice="choose another --out")
        check_comparable(list(reports.values()))
        grids = [ablation_grid(reports, self.views), steps_grid(reports, self.views)]
        write_text(self.out / TABLE, "\n\n".join(printed(grid, "markdown") for grid in grids) + "\n")
        return "\n\n".join([*(printed(grid, "text") for grid in grids), f"The same in Markdown: {self.out / TABLE}"])

    def _cost(self, runs: int, device: str) -> str:
        """What would be trained, and an estimate of the time from three steps of the full method."""
        from tempfile import TemporaryDirectory

        from semgs.training.loop import train

        settings = replace(self.settings, steps=TIMED_STEPS, validation_scenes=0, scene_reuse=1)
        warm = replace(settings, steps=1)
        with TemporaryDirectory() as folder, show_stage("Timing three steps"), what_the_user_gave():
            execution = Execution(device, workers=0)
            train(warm, Path(folder) / "warm", execution)
            began = time.perf_counter()
            train(settings, Path(folder) / "timed", execution)
            seconds = (time.perf_counter() - began) / TIMED_STEPS
        full = self.settings
        height, width = full.size
        minutes = full.steps * seconds / 60
        return (
            f"{runs} trainings of {full.steps} steps of {full.batch} scenes at {height}x{width} ({runs * full.steps} steps), then "
            f"{runs} evaluations with {self.views} views\n"
            f"about {seconds:.2f} s per step on this machine: {minutes:.0f} min per training, {runs * minutes / 60:.1f} h in total, "
            "not counting evaluation and validation"
        )
