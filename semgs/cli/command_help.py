"""The help of commands, from the fields, comments and docstrings of their options. Help texts are paragraphs."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, is_dataclass
from functools import cache
from typing import Any

import cyclopts
import docstring_parser

from semgs.cli.options.typed_options import Option, app_for, options_of


@dataclass(frozen=True)
class Help:
    """The help of a command.

    Attributes:
        usage: one line.
        about: what the command does, as paragraphs; examples last.
        groups: options by the title of their group, each as it is typed, with its help.
    """

    usage: str
    about: str
    groups: Mapping[str, Sequence[tuple[str, str]]]


def help_of(options: type, program: str, preset: str = "") -> Help:
    """The help of a command; with the settings of a preset if it has some and one is named."""
    found, presets = _shown(options, preset), getattr(options, "presets", {})
    groups = defaultdict(list)
    for option in found:
        words = option.words.metavar or ""
        default = option.words.shows(option.default)
        text = _texts(option.owner).get(option.path[-1], "")
        typed = words if option.words.positional else f"{option.flag} {words}".rstrip()
        groups[_title(options, option)].append((typed, f"{text} [default: {default}]" if default else text))
    choices = [] if preset or not presets else [f"{{{','.join(presets)}}}"]
    named = [option.words.metavar for option in found if option.words.positional]
    needed = [option.named for option in found if option.default is MISSING and not option.words.positional]
    usage = " ".join(filter(None, (program, preset, *choices, *named, *needed, "[OPTIONS]")))
    about = description_of(presets[preset] if preset else options)
    listed = [f"- {name}: {description_of(make)}" for name, make in presets.items()] if choices else []
    return Help(usage, "\n".join((about, *(("", "Presets") if listed else ()), *listed)), groups)


def print_help(options: type, program: str, preset: str) -> None:
    """Print what a command does, and its options."""
    found, told = _shown(options, preset), help_of(options, program, preset)
    groups = {title: cyclopts.Group.create_ordered(title) for title in told.groups}
    app = app_for(
        program,
        found,
        help=[_texts(option.owner).get(option.path[-1]) for option in found],
        show_default=[option.words.shows(option.default) or False for option in found],
        required=[option.default is MISSING for option in found],
        group=[None if option.words.positional else groups[_title(options, option)] for option in found],
    )
    app.usage, app.help = told.usage, told.about
    app.help_print([])


def _shown(options: type, preset: str) -> list[Option]:
    """The options in a help: positions first, then those of the command itself; those of settings only with a preset."""
    presets = getattr(options, "presets", {})
    start = presets[preset or next(iter(presets))]() if presets else None
    found = [option for option in options_of(options, None, start) if preset or not option.of_preset]
    return sorted(found, key=lambda option: (not option.words.positional, option.owner is not options))


@cache
def _texts(owner: type) -> dict[str, str]:
    """The help of each field of a dataclass, as paragraphs. It is read from source code, which takes long."""
    kinds = [kind for kind in reversed(owner.__mro__) if is_dataclass(kind)]
    told = [one for kind in kinds for one in docstring_parser.parse_from_object(kind).params]
    return {one.arg_name: paragraphs(one.description or "") for one in told}


def _title(options: type, option: Option) -> str:
    """What the group of an option is called: for a dataclass among the options, from the first sentence about it."""
    if option.owner is options:
        return "Arguments" if option.words.positional else "Options"
    return re.split(r"[.:\n]", description_of(option.owner))[0]


def description_of(explained: Any) -> str:
    """What something does, from its docstring, as paragraphs."""
    return paragraphs(docstring_parser.parse(explained.__doc__ or "").description or "")


def paragraphs(text: str) -> str:
    """A text without line breaks, except between paragraphs and before the items of a list."""
    return re.sub(r"(?<!\n)\n[ \t]*(?![ \t]*(?:\n|- ))", " ", text.strip())
