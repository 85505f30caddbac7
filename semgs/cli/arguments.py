"""Parses the arguments of a command into its options, or says in one line what is wrong. No torch.

cyclopts finds the words of each option; `semgs.run.options.words` says what they mean.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, fields, replace
from typing import Any, TypeVar

import cyclopts

from semgs.cli.options.typed_options import Option, app_for, default_of, options_of
from semgs.files.text import did_you_mean
from semgs.run.options.words import words_of
from semgs.run.usage_errors import UsageError

Options = TypeVar("Options")

PRESET, LAST = ("", "preset"), ("", "last word")
"""Where two words are that only some commands take: the name of a preset, and the output as the last word."""


def parse(options: type[Options], program: str, arguments: Sequence[str]) -> Options:
    """Parse the arguments of a command; `--help` prints its help and exits with 0.

    Args:
        options: a dataclass whose fields, comments and docstring are the help. Fields that are dataclasses give their own fields as options. Three class variables say more:
            `excludes` has what cannot go with an option, and `only_with` what is for it alone, as flags or with values ("--as mesh mujoco"); `presets` has functions by
            name that make the field `settings`. The arguments then name one, and each flag among the settings has a pair, --x and --no-x.
        program: the command, such as "semgs train".
        arguments: the words after it.

    Raises:
        UsageError: an option is unknown (the most similar one is suggested), missing, has an invalid value, or does not go with the others.
        SystemExit: with 0 after `--help`.
    """
    presets: Mapping[str, Any] = getattr(options, "presets", {})
    preset = next((word for word in arguments if word in presets), "")
    if {"-h", "--help"} & set(arguments):
        from semgs.cli.command_help import print_help

        print_help(options, program, preset)
        raise SystemExit(0)
    found = [*options_of(options, None, presets[preset or next(iter(presets))]() if presets else None)]
    if presets:
        found.insert(0, Option(PRESET, f"a preset ({', '.join(presets)})", words_of(str)[1], MISSING, options))
    try:
        typed = _typed(f"{program} {preset}", found, arguments)
        preset = typed.get(PRESET, "")
        if preset and preset not in presets:
            raise ValueError(
                f"unknown preset {preset!r}{did_you_mean(preset, presets)}; expected one of {', '.join(presets)}"
            )
        values = {one.path: _read(one, typed[one.path]) for one in found if one.path in typed}
        _check_given(f"{program} {preset}".rstrip(), found, values)
        return _build(options, None, values, presets[preset]() if presets else None)
    except ValueError as error:
        raise UsageError(f"{error}; see {program}{f' {preset}' if preset in presets else ''} --help") from None


def _typed(program: str, found: Sequence[Option], arguments: Sequence[str]) -> dict[tuple[str, ...], Any]:
    """What is typed of each option, by where it is: a word, or several, or whether a flag is on.

    Raises:
        ValueError: an option is unknown, or has too many or too few words; or the output is named twice.
    """
    outputs = [option for option in found if option.words.last]
    taken = [*found, *(Option(LAST, "OUT", words_of(str)[1], None, output.owner) for output in outputs)]
    try:
        _, bound, _ = app_for(program, taken).parse_args(list(arguments), exit_on_error=False, print_error=False)
    except cyclopts.CycloptsError as error:
        raise ValueError(_told(error, taken)) from None
    typed = {taken[int(name.removeprefix("_"))].path: words for name, words in bound.arguments.items()}
    if (last := typed.pop(LAST, None)) is not None:
        if outputs[0].path in typed:
            raise ValueError(_too_many(last))
        typed[outputs[0].path] = last
    return typed


def _too_many(word: str) -> str:
    return f"expected one output, as --out OUT or as the last word; leave out {word}"


def _told(error: cyclopts.CycloptsError, found: Sequence[Option]) -> str:
    """What cyclopts finds wrong, in our words."""
    if isinstance(error, cyclopts.UnknownOptionError):
        typed = (error.token.keyword or error.token.value).partition("=")[0]
        return f"there is no option {typed}{did_you_mean(typed, [option.flag for option in found])}"
    if isinstance(error, cyclopts.MissingArgumentError) and error.argument is not None:
        flag, found_words = error.argument.name, len(error.tokens_so_far)
        count = next(option.words.count for option in found if option.flag == flag)
        least, most = (count, count) if isinstance(count, int) else count
        least_or_most = "" if least == most else "at most " if found_words else "at least "
        wanted = f"{most} values" if most and most > 1 else "one value"
        return f"{flag}: expected {least_or_most}{wanted}, found {found_words or 'none'}"
    if isinstance(error, cyclopts.CoercionError) and error.token is not None:
        return f"{error.token.keyword}: expected no value, found {error.token.value!r}"
    if error.unused_tokens:
        word = error.unused_tokens[0]
        return _too_many(word) if any(option.path == LAST for option in found) else f"unexpected argument {word!r}"
    return " ".join(str(error).split())


def _check_given(program: str, found: Sequence[Option], values: Mapping[tuple[str, ...], Any]) -> None:
    """Check which options are given.

    Raises:
        ValueError: some are missing, all of which are named, cannot go together, or are for another mode.
    """
    missing = [one.named for one in found if one.default is MISSING and one.path not in values]
    if missing:
        raise ValueError(f"{program} needs {' and '.join(filter(None, (', '.join(missing[:-1]), missing[-1])))}")
    options = {one.flag: one for one in found}

    def holds(condition: str) -> bool:
        """Whether an option has another value than by default, as "--html"; or has one of some values, as "--as mesh mujoco"."""
        flag, *words = condition.split()
        default = options[flag].default
        value = values.get(options[flag].path, default)
        if not words:
            return bool(value != default)
        return bool(set(words) & set(map(str, value if isinstance(value, tuple) else (value,))))

    for owner in dict.fromkeys(one.owner for one in found):
        for condition, others in getattr(owner, "excludes", {}).items():
            if holds(condition) and (both := next(filter(holds, others), "")):
                raise ValueError(f"{both} cannot go with {condition}")
        for condition, others in getattr(owner, "only_with", {}).items():
            if not holds(condition) and (stray := next(filter(holds, others), "")):
                flag, *words = condition.split()
                raise ValueError(f"{stray} is for {' '.join((flag, ' and '.join(words))).rstrip()}")


def _read(option: Option, typed: Any) -> Any:
    """The value of an option.

    Raises:
        ValueError: it cannot be read.
    """
    if option.words.read is None:
        return typed
    try:
        return option.words.read([typed] if isinstance(typed, str) else list(typed))
    except ValueError as error:
        raise ValueError(f"{option.flag}: {error}") from None


def _build(kind: Any, start: Any, values: Mapping[tuple[str, ...], Any], preset: Any = None) -> Any:
    """A dataclass with the values of its fields, by where they are in it; what is not among them is as `start` has it, or as its class does.

    Raises:
        ValueError: the dataclass refuses its values.
    """
    given = {path[0]: value for path, value in values.items() if len(path) == 1}
    for field in fields(kind):
        inner = {path[1:]: value for path, value in values.items() if path[0] == field.name and len(path) > 1}
        default = default_of(field, start, preset)
        if inner:
            try:
                given[field.name] = _build(type(default), default, inner)
            except ValueError as error:
                raise ValueError(str(error) if start is None else f"{field.name}: {error}") from None
        elif field.name == "settings" and preset is not None:
            given[field.name] = preset
    return kind(**given) if start is None else replace(start, **given)
