"""Parses the arguments of a command into its options, or says in one line what is wrong. No torch.

Help texts are paragraphs. tyro keeps line breaks that they have in the source, which then end lines early.
"""

from __future__ import annotations

import dataclasses
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from itertools import pairwise, takewhile
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import docstring_parser
import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo

from semgs.files.paths import typed_path
from semgs.files.text import did_you_mean
from semgs.run.options.types import BY_POSITION
from semgs.run.usage_errors import UsageError

Options = TypeVar("Options")

REFUSED = 2
"""The exit code with which tyro refuses arguments."""

_TYPES = ConstructorRegistry()
"""Parsing rules in addition to tyro's."""


@_TYPES.primitive_rule
def _paths(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Path] | None:
    """Reads paths with `typed_path`."""
    if info.type is not Path:
        return None
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="PATH",
        instance_from_str=lambda typed: typed_path(typed[0]),
        is_instance=lambda instance: isinstance(instance, Path),
        str_from_instance=lambda path: [str(path)],
    )


@_TYPES.primitive_rule
def _numbers(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    """Reads numbers, alone or in tuples, and says of any other word what was expected."""
    in_tuple = get_origin(info.type) is tuple
    kinds = get_args(info.type) if in_tuple else (info.type,)
    several = kinds[-1] is Ellipsis
    if several:
        kinds = kinds[:1]
    if not set(kinds) <= {int, float}:
        return None
    words = " ".join(kind.__name__.upper() for kind in kinds)

    def read(typed: list[str]) -> Any:
        numbers = tuple(map(_number, kinds * len(typed) if several else kinds, typed))
        return numbers if in_tuple else numbers[0]

    return PrimitiveConstructorSpec(
        nargs="*" if several else len(kinds),
        metavar=f"[{words} [{words} ...]]" if several else words,
        instance_from_str=read,
        is_instance=lambda value: in_tuple == isinstance(value, tuple),
        str_from_instance=lambda value: list(map(str, value if in_tuple else (value,))),
    )


def _number(kind: type[int] | type[float], word: str) -> float:
    """The number that a word says."""
    try:
        return kind(word)
    except ValueError:
        raise ValueError(f"expected a {'whole ' if kind is int else ''}number, found {word!r}") from None


_TYPE = r"- (?:typing\.Annotated\[.*?\)\]|(?:typing\.Literal|tuple)\[[^]]*\]|<class '[\w.]+'>): "
"""How tyro names a type before the reason why a value is not of it."""

_OR_NONE = re.compile(rf"(?<=: )no type matching .*?Got errors: {_TYPE}(?!.* {_TYPE})")
"""What tyro says before the reason if an option has None as its default, which cannot be typed."""

_CHOICES = re.compile(
    r"invalid choice (?P<found>.+?) for argument '(?P<option>[^']+)'\. Expected one of \((?P<known>.*?),?\)"
    r"|(?P<typed>--[\w.-]+): \[(?P<word>[^]]*)\] does not match choices \((?P<words>.*?),?\)"
)
"""What tyro says of a word that is none of the known ones."""

_COUNT = re.compile(
    r"(?P<option>--[\w.-]+): input length (?P<found>\d+) did not match expected argument count (?P<wanted>\d+) of `.*?`"
    r"|Missing value for argument '(?P<short>[^']+)'\. Expected (?P<needed>\d+) values"
)
"""What tyro says of too many or too few words."""

_WORD_TOO_MANY = re.compile(r"^Unrecognized options: (?!-)")
"""What tyro says before words that are no options."""


def parse(options: type[Options], program: str, arguments: Sequence[str]) -> Options:
    """Parse the arguments of a command; `--help` prints its help and exits with 0.

    Args:
        options: a dataclass whose fields, comments and docstring are the help. If it has `presets`, names of settings to start from, the
            arguments must name one; each flag then has a pair, --x and --no-x, because presets switch it on or off.
        program: the command, such as "semgs train".
        arguments: the words after it.

    Raises:
        UsageError: an option is unknown (the most similar one is suggested), missing, or has an invalid value.
        SystemExit: with 0 after `--help`, or because of a signal.
    """
    printed = io.StringIO()
    try:
        with redirect_stderr(printed):
            parsed = _parse(options, program, arguments)
    except SystemExit as leaving:
        if leaving.code != REFUSED:
            raise  # after --help, or because of a signal
        box = printed.getvalue()
        preset = _named_preset(options, arguments, box)
        program += f" {preset}" if preset else ""  # its help lists its settings
        message = (
            _ask_for_preset(options, program, arguments, box)
            if not preset and _presets(options)
            else _suggest_option(options, program, preset, arguments, box)
        )
        message = message or _name_missing(program, box) or _message_in_box(box)
        if _may_take_position(options):
            message = _WORD_TOO_MANY.sub("expected one output, as --out OUT or as the last word; leave out ", message)
        raise UsageError(f"{message}; see {program} --help") from None
    for option in (word for word in arguments if word.startswith("--")):
        if getattr(parsed, option.removeprefix("--").replace("-", "_"), None) == ():
            raise UsageError(f"{option}: expected at least one value, found none; see {program} --help")
    return parsed


def _parse(options: type[Options], program: str, arguments: Sequence[str]) -> Options:
    """The options as tyro parses them. If the arguments are wrong, tyro prints why to stderr and exits."""
    description = None
    if {"-h", "--help"} & set(arguments):
        join_lines(options)
        description = description_of(options)
    config = (tyro.conf.DisallowNone,) if _presets(options) else (tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone)
    named = {word.partition("=")[0] for word in arguments}
    kind = options if named & {"--out", "-h", "--help"} else _with_out_as_position(options)
    parsed: Options = tyro.cli(
        kind, prog=program, args=list(arguments), description=description, config=config, registry=_TYPES
    )
    return parsed if kind is options else options(**vars(parsed))


def _may_take_position(options: type) -> bool:
    """Whether the command also takes its output as the last position."""
    out = get_type_hints(options, include_extras=True).get("out")
    return BY_POSITION in getattr(out, "__metadata__", ())


def _with_out_as_position(options: type) -> type:
    """The options with the output as a position, which errors still name --out; the same where it cannot be one."""
    if not _may_take_position(options):
        return options
    (out,) = (field for field in dataclasses.fields(options) if field.name == "out")
    kind = Annotated[Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="--out OUT")]
    position = ("out", kind, dataclasses.field(default=out.default))
    return dataclasses.make_dataclass(options.__name__, [position], bases=(options,), frozen=True)


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


def _presets(options: type) -> tuple[str, ...]:
    """The names of settings of which a command needs one."""
    return getattr(options, "presets", ())


def _named_preset(options: type, arguments: Sequence[str], box: str) -> str:
    """The preset that the arguments name; "" for none."""
    if any(phrase in _without_colours(box) for phrase in ("Available subcommands", "Expected one of {")):
        return ""
    return next((word for word in arguments if word in _presets(options)), "")


def _ask_for_preset(options: type, program: str, arguments: Sequence[str], box: str) -> str:
    """Says that the preset is missing or unknown, with the most similar one."""
    presets, (first, *_) = _presets(options), (*arguments, "-")
    values = [word for before, word in pairwise(("", *arguments)) if not before.startswith("-")]
    similar = next((word for word in values if did_you_mean(word, presets)), "")
    if typed := similar or ("" if first.startswith("-") else first):
        return f"unknown preset {typed!r}{did_you_mean(typed, presets)}; expected one of {', '.join(presets)}"
    missing = _name_missing(program, box).removeprefix(f"{program} needs ")
    return f"{program} needs a preset ({', '.join(presets)}){f' and {missing}' if missing else ''}"


def _suggest_option(options: type, program: str, preset: str, arguments: Sequence[str], box: str) -> str:
    """Names the first option that tyro did not recognise and the most similar known one; "" if no option is similar.

    The settings of a preset are options, too, but only after its name.
    """
    _, _, unknown = _without_colours(box).partition("Unrecognized options")
    printed = io.StringIO()
    with suppress(SystemExit), redirect_stdout(printed), redirect_stderr(io.StringIO()):
        _parse(options, program, [*filter(None, [preset]), "--help"])
    known = re.findall(r"(?:^|[│ ]{2}|, )(--[\w.-]+)", _without_colours(printed.getvalue()), re.MULTILINE)
    for typed in (word.split("=")[0] for word in arguments if word.startswith("--")):
        if not re.search(rf"(?<![\w-]){re.escape(typed)}(?![\w-])", unknown):
            continue
        if preset and typed in known:
            return f"{typed} must come after {preset}"
        if advice := did_you_mean(typed, known):
            return f"there is no option {typed}{advice}"
    return ""


def _name_missing(program: str, box: str) -> str:
    """Names the required arguments that are missing, without their help texts; "" if the box that tyro prints is about something else."""
    lines = [line.strip("│").rstrip() for line in _without_colours(box).splitlines()]
    at = next((at for at, line in enumerate(lines) if line.lstrip().startswith("Missing from ")), None)
    if at is None:
        return ""
    named = takewhile(lambda line: set(line.strip()) - set("─-"), lines[at + 1 :])  # up to the rule before the advice
    indent = len(lines[at]) - len(lines[at].lstrip()) + 4  # help texts are indented further
    *others, last = (line.strip() for line in named if len(line) - len(line.lstrip()) == indent)
    return f"{program} needs {', '.join(others)}{' and ' if others else ''}{last}"


def _known_words(said: re.Match[str]) -> str:
    """Says which words an option takes. tyro lists None among them, in any order, for options that have it as their default."""
    words = re.findall(r"'([^']*)'", said["known"] or said["words"])
    known = sorted(set(words) - {"None"}) if "None" in words else words
    return (
        f"{said['option'] or said['typed']}: expected one of {', '.join(known)}, found {said['found'] or said['word']}"
    )


def _how_many(said: re.Match[str]) -> str:
    """Says how many values an option takes."""
    wanted, found = said["wanted"] or said["needed"], said["found"] or "fewer"
    if wanted == "1":
        return f"{said['short']}: expected a value, found none"
    return f"{said['option'] or said['short']}: expected {wanted} values, found {'none' if found == '0' else found}"


def _without_colours(text: str) -> str:
    """Text without colour codes."""
    return re.sub(r"\x1b\[[0-9;]*m", "", text)


def _message_in_box(box: str) -> str:
    """The message in the box that tyro prints, without frame, title and help text. The list of presets is kept.

    If stdout cannot show frames, tyro prints title and parts below each other, separated by dashes.
    """
    lines = [line.strip(" │") for line in _without_colours(box).splitlines()]
    framed = any(line.startswith("╭") for line in lines)
    parts: list[list[str]] = [[]]
    for line in lines:
        if line and set(line) <= {"─", "-"}:
            parts.append([])
        elif line and not line.startswith(("╭", "╰")):
            parts[-1].append(line)
    first = 0 if framed or len(parts) == 1 else 1
    presets = [
        f"; {' '.join(part)}" for part in parts[first + 1 :] if part and part[0].startswith("Available subcommands")
    ]
    message = " ".join(parts[first]).rstrip(".").removeprefix("Error parsing ")
    message = _COUNT.sub(_how_many, _CHOICES.sub(_known_words, _OR_NONE.sub("", message)))
    return "".join([message, *presets]) or "the arguments cannot be understood"
