"""Output streams of a command: open, able to print any character, and safe from control characters in names."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import Any

from semgs.files.text import printable


class Printable:
    """A stream that escapes control characters, which names of files, scenes and classes may contain."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write text, escaped. Returns its length before escaping."""
        self._stream.write(printable(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        """Everything else is that of the underlying stream."""
        return getattr(self._stream, name)


def open_streams() -> None:
    """Make sure that stdout and stderr accept any text.

    A closed stream (`>&-`) is redirected to nowhere, so that no later file gets its number. Characters that the encoding lacks are escaped.
    """
    for name in ("stdout", "stderr"):  # in the order of their numbers, which are given to the next that is opened
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
