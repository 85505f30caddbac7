"""Options of a command: the fields of its dataclass, as they are typed, and what of cyclopts finds their words or draws their help. No torch."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, is_dataclass
from inspect import Parameter, Signature
from typing import Annotated, Any, get_type_hints

import cyclopts

from semgs.run.options.words import Words, words_of


@dataclass(frozen=True, eq=False)
class Option:
    """A field of the options, or of a dataclass among them, as it is typed.

    Attributes:
        path: the fields that lead to it.
        flag: "--losses.smoothness"; or what a position is called, such as "SCENE".
        words: of it; those of a flag cannot be read.
        default: `MISSING` if it is required.
        owner: the dataclass with the field.
        of_preset: whether a preset has its default.
    """

    path: tuple[str, ...]
    flag: str
    words: Words
    default: Any
    owner: type
    of_preset: bool = False

    @property
    def named(self) -> str:
        """As a message names it: "--out OUT", or "SCENE"."""
        return f"{self.flag} {self.words.metavar}" if self.flag.startswith("--") else self.flag


def options_of(kind: Any, start: Any, preset: Any, path: tuple[str, ...] = (), dots: str = "") -> Iterator[Option]:
    """The options of a dataclass.

    Args:
        kind: the dataclass.
        start: an instance with other defaults than its class; None for these.
        preset: as `start`, for the field `settings`.
        path, dots: where the dataclass is, and what its options begin with.
    """
    hints = get_type_hints(kind, include_extras=True)
    for field in fields(kind):
        hint, words = words_of(hints[field.name])
        here, default = (*path, field.name), default_of(field, start, preset)
        name = words.name or field.name.replace("_", "-")
        if is_dataclass(hint) and words.read is None:
            yield from options_of(hint, default, None, here, dots if words.inline else f"{dots}{name}.")
        elif not words.hidden:
            flag = (words.metavar or "").split()[0].strip("[]") if words.positional else f"--{dots}{name}"
            yield Option(here, flag, words, default, kind, here[0] == "settings")


def default_of(field: Any, start: Any, preset: Any) -> Any:
    """The default of a field, or `MISSING`."""
    if start is not None:
        return getattr(start, field.name)
    if field.name == "settings" and preset is not None:
        return preset
    return field.default if field.default_factory is MISSING else field.default_factory()


def app_for(program: str, found: Sequence[Option], **more: Sequence[Any]) -> cyclopts.App:
    """What finds the words of options, or prints their help: then `more` has what cyclopts needs for it, a list of values by name."""

    def command(**words: Any) -> None:
        """Never called."""

    places = []
    for number, option in enumerate(found):
        told = {name: values[number] for name, values in more.items() if values[number] is not None}
        places.append(_place(f"_{number}", option, told))
    command.__signature__ = Signature(sorted(places, key=lambda place: place.kind))  # type: ignore[attr-defined]
    app = cyclopts.App(name=program, help_flags=(), version_flags=(), help_format="plaintext")
    app.default(command)
    return app


def _place(name: str, option: Option, more: Mapping[str, Any]) -> Parameter:
    """An option as cyclopts takes it: as words, and never required, so that all that are missing can be named at once. If a command names an option again, the last counts."""
    words, is_option = option.words, option.flag.startswith("--")
    is_flag = is_option and words.read is None
    several = None if words.repeatable or isinstance(words.count, int) else words.count
    kind: Any = tuple[str, ...]
    default: Any = ()
    if is_flag:
        kind, default = bool, False
    elif words.count == 1 and not words.repeatable:
        kind, default = str, ""
    elif several is None and not words.repeatable:
        kind, default = tuple[(str,) * words.count], ("",) * words.count  # type: ignore[misc, operator]
    told = cyclopts.Parameter(
        name=option.flag,
        metavar=words.metavar,
        negative=re.sub(r"([^.-][^.]*)$", r"no-\1", option.flag) if is_flag and option.of_preset else (),
        consume_multiple=several,
        allow_repeating=True,
        allow_leading_hyphen=words.dashed,
        **more,
    )
    where = Parameter.KEYWORD_ONLY if is_option else Parameter.POSITIONAL_ONLY
    return Parameter(name, where, default=default, annotation=Annotated[kind, told])
