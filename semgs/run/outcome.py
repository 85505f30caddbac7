"""What users run, and what comes of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from semgs.runtime.notes import Progress


@dataclass(frozen=True)
class Outcome:
    """What a run says when it is done.

    Attributes:
        lines: for a terminal.
        notes: what the user should know about the result.
        lacking: what could not be written, and why; a line each.
        code: exit code of a command.
    """

    lines: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    lacking: tuple[str, ...] = ()
    code: int = 0


@dataclass(frozen=True)
class Run(ABC):
    """Options, as a dataclass, of something that users run. Its docstring and those of its fields are the help of its command."""

    @abstractmethod
    def run(self, progress: Progress) -> Outcome:
        """Check the options, and do it.

        Raises:
            InputError: a file or folder cannot be used.
            UsageError: an option is invalid, or there is too little memory or disk.
            ImportError: a library that an option needs is not installed.
        """
