"""Arguments: what was typed becomes a command's options, or one line that says what is wrong. No torch."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from contextlib import redirect_stderr
from pathlib import Path
from typing import TypeVar

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from semgs.cli.errors import UsageError
from semgs.files.paths import typed_path

Options = TypeVar("Options")

SMALLEST_SIDE, LARGEST_SIDE = 32, 4096
"""Sides of the pictures that can be asked for [px]."""


_TYPES = ConstructorRegistry()
"""How what was typed becomes what options hold, where that is not tyro's own way."""


@_TYPES.primitive_rule
def _paths(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Path] | None:
    """Paths, by `typed_path`."""
    if info.type is not Path:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="PATH",
        instance_from_str=lambda typed: typed_path(typed[0]),
        is_instance=lambda instance: isinstance(instance, Path),
        str_from_instance=lambda path: [str(path)],
    )


def parse(options: type[Options], name: str, arguments: Sequence[str]) -> Options:
    """The options of a command from its arguments; `--help` prints its help and leaves with 0.

    Args:
        options: a dataclass whose fields, comments and docstring are the help.
        name: of the command.
        arguments: what was typed behind the name.

    Raises:
        UsageError: an option is unknown, missing or has an impossible value.
        SystemExit: with 0, after `--help`.
    """
    told = io.StringIO()
    try:
        with redirect_stderr(told):
            return tyro.cli(
                options,
                prog=f"semgs {name}",
                args=list(arguments),
                config=(tyro.conf.FlagCreatePairsOff,),
                registry=_TYPES,
            )
    except SystemExit as leaving:
        if leaving.code in (None, 0):
            raise
        raise UsageError(f"{_one_line(told.getvalue())}; see semgs {name} --help") from None


def parse_size(text: str) -> tuple[int, int] | None:
    """(height, width) [px] of "240x320", None of "auto".

    Raises:
        UsageError: it is neither, or a side is outside 32 to 4096.
    """
    if text == "auto":
        return None
    match = re.fullmatch(r"(\d{1,6})[x×X](\d{1,6})", text)
    if not match:
        raise UsageError(f"--size is {text!r}; expected height x width in pixels, such as 240x320")
    height, width = int(match[1]), int(match[2])
    if not all(SMALLEST_SIDE <= side <= LARGEST_SIDE for side in (height, width)):
        raise UsageError(f"--size is {text}; expected sides from {SMALLEST_SIDE} to {LARGEST_SIDE} pixels")
    return height, width


def _one_line(box: str) -> str:
    """The message inside the box that tyro draws, without its frame, title and the help below it.

    Where stdout cannot show frames, tyro draws the title and the parts below each other with dashes between them.
    """
    lines = [line.strip(" │") for line in re.sub(r"\x1b\[[0-9;]*m", "", box).splitlines()]
    framed = any(line.startswith("╭") for line in lines)
    parts: list[list[str]] = [[]]
    for line in lines:
        if line and set(line) <= {"─", "-"}:
            parts.append([])
        elif line and not line.startswith(("╭", "╰")):
            parts[-1].append(line)
    message = parts[0] if framed or len(parts) == 1 else parts[1]
    return " ".join(message).rstrip(".") or "the arguments cannot be understood"
