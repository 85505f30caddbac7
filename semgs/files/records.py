"""Records: frozen dataclasses that check their values, and are made from the content of a JSON file, with cattrs. Nothing is converted: 1 is no true, and "1" is no number."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import is_dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Union, get_args, get_origin

if TYPE_CHECKING:
    from cattrs import Converter

Record = TypeVar("Record")


def make_record(kind: type[Record], content: object, largest: int | None = None) -> Record:
    """A dataclass, with the dataclasses inside it, from the content of a JSON file: an object for each, whose missing keys take the
    fields' defaults. Lists become tuples. Of several dataclasses that may stand in a field, the one is made whose literal `kind` is given.

    Args:
        kind: the dataclass.
        content: from `parse_json`.
        largest: integers must be in 0 to this; None allows all.

    Raises:
        ValueError: a key is unknown or missing, a value has another type or is not finite, or a dataclass refuses its values. The first
            such key is named.
    """
    from cattrs import BaseValidationError, transform_error

    if not isinstance(content, dict):
        raise ValueError(f"expected an object, found {content!r:.60}")
    try:
        return _converter(largest).structure(content, kind)
    except BaseValidationError as error:
        text, _, place = transform_error(error, "", _describe)[0].rpartition(" @ ")
        raise ValueError(f"{place.lstrip('.')}: {text}" if place else text) from None


@cache
def _converter(largest: int | None) -> Converter:
    """A converter that makes dataclasses and tuples, and takes other values only as they are."""
    from cattrs import Converter
    from cattrs.strategies import configure_union_passthrough

    def whole(value: Any, kind: type) -> int:
        if largest is not None and not 0 <= _exact(value, kind) <= largest:
            raise ValueError(f"expected a whole number in 0..{largest}, found {value!r:.60}")
        return _exact(value, kind)

    converter = Converter(forbid_extra_keys=True)
    for kind in (bool, str):
        converter.register_structure_hook(kind, _exact)
    converter.register_structure_hook(int, whole)
    converter.register_structure_hook(float, _finite)
    configure_union_passthrough(Union[bool, int, float, str, None], converter)  # noqa: UP007
    converter.register_structure_hook_factory(_are_dataclasses, lambda union: _by_kind(union, converter))
    return converter


def _are_dataclasses(hint: object) -> bool:
    """Whether a type is a union of several dataclasses."""
    return len(get_args(hint)) > 1 and all(map(is_dataclass, get_args(hint)))


def _by_kind(union: object, converter: Converter) -> Callable[[Any, object], object]:
    """Makes the dataclass of a union whose `kind` is given."""
    parts = {part.kind: part for part in get_args(union)}

    def make(value: Any, _: object) -> object:
        kind = value.get("kind") if isinstance(value, dict) else None
        if kind not in parts:
            raise ValueError(f"kind is {kind!r}; expected {' or '.join(parts)}")
        return converter.structure(value, parts[kind])

    return make


def _exact(value: object, kind: type) -> Any:
    """A value of a type."""
    if type(value) is not kind:
        raise ValueError(f"expected {kind.__name__}, found {value!r:.60}")
    return value


def _finite(value: object, _: type) -> float:
    """A finite number."""
    if type(value) not in (int, float) or not math.isfinite(value):  # type: ignore[arg-type]
        raise ValueError(f"expected a finite number, found {value!r:.60}")
    return value  # type: ignore[return-value]


def _describe(error: BaseException, kind: object) -> str:
    """What is wrong, in words."""
    from cattrs import ForbiddenExtraKeysError

    if isinstance(error, ForbiddenExtraKeysError):
        return f"this version of semgs does not know {', '.join(sorted(error.extra_fields))}"
    if isinstance(error, KeyError):
        return "missing"
    if get_origin(kind) is Literal:
        return f"expected {' or '.join(map(str, get_args(kind)))}, found another value"
    if isinstance(error, TypeError | AttributeError):
        return f"expected {getattr(kind, '__name__', kind)}, found a value of another type"
    return str(error)


def check_values(values: object, **checks: tuple[bool, str]) -> None:
    """Refuse the first value that does not hold.

    Args:
        values: the settings, whose attributes have the names of the checks; "augmentation.roll" is one of an attribute.
        checks: for each name whether the value holds, and what is expected otherwise.

    Raises:
        ValueError: a value does not hold.
    """
    for name, (holds, expected) in checks.items():
        if not holds:
            value = values
            for attribute in name.split("."):
                value = getattr(value, attribute)
            raise ValueError(f"{name} is {value!r}; expected {expected}")
