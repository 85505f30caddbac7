"""An error to plant."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """One planted error.

    Attributes:
        name: what is wrong.
        file: where, from the root.
        before: the text that is replaced, once in its file.
        after: what stands there instead.
        tests: files of tests (or tests) that should fail, from the root.
    """

    name: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]
