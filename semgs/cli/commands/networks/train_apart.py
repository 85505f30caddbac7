"""Trains a run folder that already has its settings in a program of its own. `semgs ablate` and `semgs recipe` need it to train several times with --devices.

    python -m semgs.cli.commands.networks.train_apart RUN '{"device": "cuda", "devices": 4}'

Lightning Fabric starts the other processes of a training by running the same program again, so each training needs its own program.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

from semgs.cli.usage_errors import UsageError
from semgs.training.run.execution import Execution


def train_apart(run: Path, execution: Execution) -> None:
    """Train a run folder that has its settings, or resume it, and wait for the end.

    Args:
        run: the folder.
        execution: how to run it.

    Raises:
        UsageError: the training failed; it has printed why.
    """
    done = subprocess.run(
        [sys.executable, "-m", "semgs.cli.commands.networks.train_apart", str(run), json.dumps(asdict(execution))],
        check=False,
    )
    if done.returncode:
        raise UsageError(f"the training in {run} ended with exit code {done.returncode}")


def main(arguments: list[str]) -> int:
    """Train with the given arguments. Returns 0, or 2 after printing an error."""
    from rich.console import Console

    from semgs.files.errors import InputError
    from semgs.training.loop import train
    from semgs.training.run.run_folder import read_settings

    run, execution = Path(arguments[0]), Execution(**json.loads(arguments[1]))
    console = Console(stderr=True, highlight=False)
    try:
        train(read_settings(run), run, execution, console=console)
    except (InputError, FloatingPointError, ImportError) as error:
        console.print(f"error: {error}", markup=False)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
