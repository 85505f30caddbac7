"""Output streams of a command: open, able to print any character, and safe from control characters in names."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import TextIO

from semgs.files.text import printable


class Plain(io.TextIOBase):
    """A stream that escapes control characters, which names of files, scenes and classes may contain."""

    def __init__(self, stream: TextIO | io.TextIOBase) -> None:
        self._stream = stream

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Of the underlying stream."""
        return self._stream.encoding

    def write(self, text: str) -> int:
        """Write text, escaped. Returns its length before escaping."""
        self._stream.write(printable(text))
        return len(text)

    def flush(self) -> None:
        """Flush the underlying stream."""
        self._stream.flush()

    def close(self) -> None:
        """Do nothing: the underlying stream is not ours. From 3.13 on, Python prints what a flush raises here when this stream is deleted."""

    def fileno(self) -> int:
        """Of the underlying stream."""
        return self._stream.fileno()

    def isatty(self) -> bool:
        """Whether the underlying stream is a terminal."""
        return self._stream.isatty()


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
