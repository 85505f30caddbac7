"""Networks that stay loaded in a process that works on many scenes, such as a worker of `semgs batch`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from semgs.runtime.stamps import stamps

Loaded = TypeVar("Loaded")

_kept: dict[Any, Any] | None = None


def keep_loaded() -> None:
    """From now on, `kept` loads each thing once in this process."""
    global _kept
    if _kept is None:
        _kept = {}


def kept(load: Callable[..., Loaded], *arguments: Any) -> Loaded:
    """What a function loads with these arguments; after `keep_loaded`, that of an earlier call with the same ones.

    Files and folders among the arguments are the same if their files have the same sizes and times.

    Args:
        load: the function. What it returns is shared and must not be changed.
        arguments: of the function; hashable.
    """
    if _kept is None:
        return load(*arguments)
    key = (load, arguments, tuple(stamps(Path(one)) for one in arguments if isinstance(one, str | Path)))
    if key not in _kept:
        _kept[key] = load(*arguments)
    return _kept[key]
