"""Faults that do not end a training at once: unreadable scenes, and steps without a finite gradient."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from safetensors.torch import save
from torch import Tensor

from semgs.files.atomic import write_bytes
from semgs.training.data.batches import Portion
from semgs.training.data.data_check.open_sources import check_bad

TOLERATED_IN_A_ROW = 10
"""A run ends after this many steps in a row without a finite gradient."""


class BadScenes:
    """Scenes that could not be read; each is reported once.

    Args:
        scenes: how many scenes there are in total.
        say: reports a sentence.
        known: bad scenes that were found before the first step.
    """

    def __init__(self, scenes: int, say: Callable[[str], None], known: Sequence[tuple[str, str]]) -> None:
        self._scenes, self._say = scenes, say
        self._known: dict[str, str] = {}
        self.add(known)

    def __len__(self) -> int:
        return len(self._known)

    def add(self, scenes: Sequence[tuple[str, str]]) -> None:
        """Add bad scenes: path and reason.

        Raises:
            InputError: there are too many now.
        """
        for path, why in scenes:
            if path not in self._known:
                self._known[path] = why
                self._say(f"bad scene, skipped: {why}")
        check_bad(list(self._known.items()), self._scenes)


def save_broken_batch(out: Path, step: int, portion: Portion, process: int | None = None) -> FloatingPointError:
    """Save the last batch of a run without finite gradients for inspection, each process its own. Returns the error that ends the run."""
    name = "bad_batch.safetensors" if process is None else f"bad_batch_{process}.safetensors"
    tensors: dict[str, Tensor] = {}
    for number, batch in enumerate(portion.pieces):
        for part, views in (("context", batch.context), ("target", batch.target)):
            values = {**vars(views), **vars(views.cameras)}
            tensors |= {
                f"{number}.{part}.{key}": value.contiguous()
                for key, value in values.items()
                if isinstance(value, Tensor)
            }
    scenes = ", ".join(scene for batch in portion.pieces for scene in batch.scenes)
    write_bytes(out / name, save(tensors, {"scenes": scenes}))
    return FloatingPointError(
        f"{out}: {TOLERATED_IN_A_ROW} steps in a row up to step {step} had no finite gradient; the last "
        f"batch is in {name}; a lower learning rate may help, from a new run folder"
    )
