"""Trains a run folder in a program of its own: an ablation trains several times with --devices.

    python -m paper.ablate.train_apart RUN '{"model": "small", ...}' '{"device": "cuda", "devices": 4}'

Lightning Fabric starts the other processes of a training by running the same program again, so each training needs its own program.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

from semgs.run.usage_errors import UsageError
from semgs.training.run.execution import Execution
from semgs.training.training_settings import TrainingSettings


def train_apart(run: Path, settings: TrainingSettings, execution: Execution) -> None:
    """Train into a run folder, or resume its run, and wait for the end.

    Args:
        run: the folder.
        settings: what to train.
        execution: how to run it.

    Raises:
        UsageError: the training failed; it has printed why.
    """
    given = [str(run), json.dumps(settings.as_json()), json.dumps(asdict(execution))]
    done = subprocess.run([sys.executable, "-m", "paper.ablate.train_apart", *given], check=False)
    if done.returncode:
        raise UsageError(f"the training in {run} ended with exit code {done.returncode}")


def main(arguments: list[str]) -> int:
    """Train with the given arguments. Returns 0, or 2 after printing an error."""
    from rich.console import Console

    from semgs.files.errors import InputError
    from semgs.training.loop import train

    run, settings = Path(arguments[0]), TrainingSettings.from_json(json.loads(arguments[1]))
    execution = Execution(**json.loads(arguments[2]))
    console = Console(stderr=True, highlight=False)
    try:
        train(settings, run, execution, console=console)
    except (InputError, FloatingPointError, ImportError) as error:
        console.print(f"error: {error}", markup=False)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
