"""Words of options: how many an option takes, and what they mean. Each field of a command's options says so by its type, and by annotations where that is not enough."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin

from semgs.files.paths import typed_path


@dataclass(frozen=True, kw_only=True)
class Words:
    """How an option is typed, as an annotation of its field. What is not stated follows from the field's type.

    Attributes:
        count: how many words it takes, or the fewest and the most (None: any number).
        metavar: what stands for the words in the help.
        read: turns the words into the value, or raises ValueError with what was expected and found.
        shown: the default as the help shows it, or what tells it from the value; "" shows none.
        name: of the option, if it is not the field's.
        positional: a position, called as its metavar.
        last: the command also takes it as the last word, as older command lines do.
        repeatable: one word each time that the option is given.
        inline: of a dataclass: its options do not begin with the field's name.
        hidden: not an option.
        dashed: a word may begin with a dash, as in `--up -z`.
    """

    count: int | tuple[int, int | None] = 1
    metavar: str | None = None
    read: Callable[[Sequence[str]], Any] | None = None
    shown: str | Callable[[Any], str] | None = None
    name: str = ""
    positional: bool = False
    last: bool = False
    repeatable: bool = False
    inline: bool = False
    hidden: bool = False
    dashed: bool = False

    def with_more(self, other: Words) -> Words:
        """The same, with what another states."""
        stated = {field.name: getattr(other, field.name) for field in fields(self)}
        return replace(self, **{name: value for name, value in stated.items() if value != getattr(Words(), name)})

    def shows(self, default: Any) -> str:
        """The default as the help shows it; "" for none."""
        if isinstance(self.shown, str):
            return self.shown
        if default is MISSING or (self.shown is None and (default in ((), "", None) or default is False)):
            return ""
        if self.shown is not None:
            return self.shown(default)
        return " ".join(map(str, default)) if isinstance(default, tuple) else str(default)


INLINE, HIDDEN, REPEATABLE, LAST_WORD = Words(inline=True), Words(hidden=True), Words(repeatable=True), Words(last=True)


def positional(metavar: str) -> Words:
    """A position instead of an option."""
    return Words(metavar=metavar, positional=True, shown="")


def one_word(metavar: str, read: Callable[[str], Any], shown: Callable[[Any], str] | None = None) -> Words:
    """An option of one word; `read` turns it into a value, or raises ValueError with what was expected and found."""
    return Words(metavar=metavar, read=lambda typed: read(typed[0]), shown=shown)


def optional(metavar: str | None = None) -> Words:
    """An option whose help shows no default: without it, there is nothing, or its text says what happens."""
    return Words(metavar=metavar, shown="")


def several(metavar: str, read: Callable[[str], Any]) -> Words:
    """An option of one or more words, each read as for `one_word`."""
    return Words(count=(1, None), metavar=metavar, read=lambda typed: tuple(map(read, typed)))


def words_of(hint: Any) -> tuple[Any, Words]:
    """The type of a field without its annotations and None, and the words that its option takes; a flag, a dataclass and any other type without words cannot be read."""
    if get_origin(hint) is Annotated:
        kind, words = words_of(hint.__origin__)
        for told in hint.__metadata__:
            words = (words if told.read is None else Words()).with_more(told) if isinstance(told, Words) else words
        return kind, words
    kinds = [kind for kind in get_args(hint) if kind not in (type(None), Ellipsis)]
    if get_origin(hint) in (Union, UnionType):
        return words_of(kinds[0]) if len(kinds) == 1 else (hint, _any_of([words_of(kind)[1] for kind in kinds]))
    if get_origin(hint) is Literal:
        known = {str(kind): kind for kind in kinds}
        choices = one_word(f"{{{', '.join(known)}}}", lambda word: _choice(known, word))
        return hint, replace(choices, dashed=any(word.startswith("-") for word in known))
    if get_origin(hint) is tuple:
        elements = [words_of(kind)[1] for kind in kinds]
        names = " ".join(element.metavar or "" for element in elements)
        if Ellipsis in get_args(hint):
            return hint, several(f"{names} [{names} ...]", lambda word: elements[0].read([word]))  # type: ignore[misc]
        return hint, Words(count=len(kinds), metavar=names, read=lambda typed: _each(elements, typed))
    return hint, _PLAIN.get(hint, Words())


def _each(elements: Sequence[Words], typed: Sequence[str]) -> tuple[Any, ...]:
    return tuple(element.read([word]) for element, word in zip(elements, typed, strict=True))  # type: ignore[misc]


def _any_of(kinds: Sequence[Words]) -> Words:
    """The words of the first type that can read them."""

    def read(typed: Sequence[str]) -> Any:
        for kind in kinds[:-1]:
            try:
                return kind.read(typed)  # type: ignore[misc]
            except ValueError:
                continue
        return kinds[-1].read(typed)  # type: ignore[misc]

    count = next((kind.count for kind in kinds if kind.count != 1), 1)
    return Words(count=count, metavar="|".join(kind.metavar or "" for kind in kinds), read=read)


def _choice(known: Mapping[str, str | int], word: str) -> str | int:
    if word not in known:
        raise ValueError(f"expected one of {', '.join(known)}, found {word!r}")
    return known[word]


Number = TypeVar("Number", int, float)


def _number(kind: type[Number], word: str) -> Number:
    try:
        return kind(word)
    except ValueError:
        raise ValueError(f"expected a {'whole ' if kind is int else ''}number, found {word!r}") from None


_PLAIN = {
    str: one_word("STR", str),
    Path: one_word("PATH", typed_path),
    int: one_word("INT", lambda word: _number(int, word)),
    float: one_word("FLOAT", lambda word: _number(float, word)),
}
