"""Trains a run folder that already has its settings in a program of its own. `semgs ablate` needs it to train several times with --devices.

    python -m semgs.cli.train_apart RUN '{"device": "cuda", "devices": 4}'

Lightning Fabric starts the other processes of a training by running the same program again, so each training needs its own program.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

from semgs.cli.errors import UsageError


def train_apart(run: Path, **options: Any) -> None:
    """Train a run folder that has its settings, or resume it, and wait for the end.

    Args:
        run: the folder.
        options: of `semgs.training.loop.train`, as JSON.

    Raises:
        UsageError: the training failed; it has printed why.
    """
    done = subprocess.run([sys.executable, "-m", "semgs.cli.train_apart", str(run), json.dumps(options)], check=False)
    if done.returncode:
        raise UsageError(f"the training in {run} ended with exit code {done.returncode}")


def main(arguments: list[str]) -> int:
    """Train with the given arguments. Returns 0, or 2 after printing an error."""
    from rich.console import Console

    from semgs.files.errors import InputError
    from semgs.training.loop import train
    from semgs.training.run import read_settings

    run, options = Path(arguments[0]), json.loads(arguments[1])
    console = Console(stderr=True, highlight=False)
    try:
        train(read_settings(run), run, console=console, **options)
    except (InputError, ValueError, FloatingPointError, ImportError) as error:
        console.print(f"error: {error}", markup=False)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
