"""What a command prints: text that a terminal shows and never obeys, on streams that are open and take any character."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path
from typing import TextIO

from semgs.files.text import printable


class Plain(io.TextIOBase):
    """A stream that shows what commands print: control characters in names of files, scenes and classes are escaped."""

    def __init__(self, stream: TextIO | io.TextIOBase) -> None:
        self._stream = stream

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Of the stream below."""
        return self._stream.encoding

    def write(self, text: str) -> int:
        """Write text, escaped; the number of characters that were given."""
        self._stream.write(printable(text))
        return len(text)

    def flush(self) -> None:
        """Pass on what is buffered."""
        self._stream.flush()

    def fileno(self) -> int:
        """Of the stream below."""
        return self._stream.fileno()

    def isatty(self) -> bool:
        """Whether the stream below is a terminal."""
        return self._stream.isatty()


def open_streams() -> None:
    """Make this process's stdout and stderr take whatever is printed.

    One that was closed (`>&-`) leads nowhere, so that no file of ours takes its number. What the encoding lacks is escaped.
    """
    for name in ("stdout", "stderr"):  # in the order of their numbers, which are given to the next that is opened
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
