"""Help texts as paragraphs. tyro keeps line breaks that they have in the source, which then end lines early."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from types import MappingProxyType
from typing import Any, get_args, get_type_hints

import docstring_parser


def join_lines(options: type) -> None:
    """Give every option of a command its help as paragraphs, in the field's metadata, where tyro looks first.

    Args:
        options: a dataclass; dataclasses among the types of its fields are included.
    """
    for one in _nested(options, set()):
        help_of = {
            told.arg_name: told.description
            for parent in filter(dataclasses.is_dataclass, reversed(one.__mro__))
            for told in docstring_parser.parse_from_object(parent).params
        }
        for field in dataclasses.fields(one):
            if text := help_of.get(field.name):
                field.metadata = MappingProxyType({**field.metadata, "help": paragraphs(text)})


def description_of(options: type) -> str:
    """What a command does, from the docstring of its options, as paragraphs."""
    return paragraphs(docstring_parser.parse(options.__doc__ or "").description or "")


def paragraphs(text: str) -> str:
    """A text without line breaks, except between paragraphs and before the items of a list."""
    return re.sub(r"(?<!\n)\n[ \t]*(?![ \t]*(?:\n|- ))", " ", text.strip())


def _nested(options: Any, seen: set[type]) -> Iterator[type]:
    """A dataclass, those in the types of its fields, and those that inherit from them, each once."""
    for argument in get_args(options):
        yield from _nested(argument, seen)
    if isinstance(options, type) and dataclasses.is_dataclass(options) and options not in seen:
        seen.add(options)
        yield options
        for kin in (*get_type_hints(options, include_extras=True).values(), *options.__subclasses__()):
            yield from _nested(kin, seen)
