"""What callers in Python give by mistake is named in one sentence: a path instead of a scene, a scene instead of its Gaussians."""

from __future__ import annotations


def check_type(what: str, value: object, kind: type | tuple[type, ...], expected: str) -> None:
    """Refuse an argument of another type.

    Args:
        what: the argument with its verb: "the encoding is".
        value: what was given.
        kind: the types that it may have.
        expected: these in words, with where to get one.

    Raises:
        TypeError: it has another type.
    """
    if not isinstance(value, kind):
        raise TypeError(f"{what} {type(value).__name__}; expected {expected}")
