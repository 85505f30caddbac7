"""What long work tells whoever waits for it: its progress, and notes.

A note is data: a kind with values. A kind has words for the command line, and for a page that shows no options.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from string import Formatter
from typing import Any


@dataclass(frozen=True)
class Kind:
    """A kind of note, or of stage: its words, with places for values as `str.format` has them.

    Call it with the values to get a note.

    Args:
        words: for the command line, such as "The unit is unknown; see --unit {unit}."
        page: for people who see no command line. None is the same words, and "" says that this is no news there.

    Raises:
        ValueError: the words for a page have a value that the others lack.
    """

    words: str
    page: str | None = None

    def __post_init__(self) -> None:
        if more := _places(self.page or "") - _places(self.words) - {"page"}:
            raise ValueError(f"{self.page!r} has {sorted(more)}, which {self.words!r} lacks")

    def __call__(self, **values: Any) -> Note:
        """A note of this kind with these values."""
        return Note(self, values)


class Note(str):
    """A sentence for the user that knows what it says: as text, it has the words for the command line.

    Args:
        kind: what it says.
        values: by the names that the words have for them.
    """

    kind: Kind
    values: dict[str, Any]

    def __new__(cls, kind: Kind, values: dict[str, Any]) -> Note:
        """The text of a kind with these values."""
        note = super().__new__(cls, kind.words.format_map(values))
        note.kind, note.values = kind, values
        return note

    def __getnewargs__(self) -> tuple[Kind, dict[str, Any]]:  # type: ignore[override]
        """Pickle kind and values, not the text."""
        return self.kind, self.values

    @property
    def on_page(self) -> str:
        """Its text for people who see no command line; empty if it is no news for them."""
        return str(self) if self.kind.page is None else self.kind.page.format_map(self.values)


def for_page(sentences: Iterable[str]) -> list[str]:
    """Sentences for people who see no command line, without those that are no news for them. One that is no `Note` stays as it is."""
    texts = (one.on_page if isinstance(one, Note) else one for one in sentences)
    return [text for text in texts if text]


def _places(words: str) -> set[str]:
    """The names of the values in words."""
    return {name for _, name, _, _ in Formatter().parse(words) if name}


class Progress:
    """Shows what is being done. This one shows nothing; the command line and the app have their own.

    Titles and lines may be a `Note`, so that each can use its own words.
    """

    @contextmanager
    def stage(self, title: str) -> Iterator[None]:
        """Show a stage as long as the block runs."""
        yield

    @contextmanager
    def steps(self, title: str, count: int) -> Iterator[Callable[[int], None]]:
        """Show a stage of counted steps. Call the yielded function with the number of steps so far."""
        yield lambda steps: None

    def announce(self, line: str) -> None:
        """Say what is about to start."""

    def compiling(self) -> None:
        """Say that kernels are compiled, once on this machine."""
