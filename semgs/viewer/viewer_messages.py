"""What a browser may send to a viewer: the few messages of its page, with values that the controls can have. viser itself takes more, for pages of other programs, and keeps it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

MOST_BYTES = 64 * 1024
"""Longest message of a browser. Those of the page have less than a kilobyte."""

CONTROL = "GuiUpdateMessage"
TAKEN = (CONTROL, "ViewerCameraMessage", "ScenePointerMessage", "SceneNodeClickMessage")
"""Types of messages that the page needs: a control was used, the camera moved, and clicks."""


def take_known_messages(server: Any) -> None:
    """From now on, a server leaves out messages that its page does not send.

    Args:
        server: of viser, before a browser has connected.
    """
    controls = server.gui._gui_input_handle_from_uuid
    receivers = server._websock_server
    _check_first(receivers, controls)
    receivers.on_client_connect(lambda connection: _check_first(connection, controls))


def is_known(message: Any, controls: Mapping[str, Any]) -> bool:
    """Whether a message is one of the page's.

    Args:
        message: of viser.
        controls: those of the panel, by identifier.
    """
    if type(message).__name__ not in TAKEN:
        return False
    if type(message).__name__ != CONTROL:
        return all(_is_plain(value) for value in _values(vars(message)))
    control = controls.get(message.uuid) if isinstance(message.uuid, str) else None
    updates = message.updates
    return control is not None and set(updates) == {"value"} and _fits(updates["value"], control)


def _check_first(receiver: Any, controls: Mapping[str, Any]) -> None:
    """Hand only known messages to what takes them."""
    take = receiver._handle_incoming_message

    async def checked(client: int, message: Any) -> None:
        if is_known(message, controls):
            await take(client, message)

    receiver._handle_incoming_message = checked


def _fits(value: Any, control: Any) -> bool:
    """Whether a control can have a value."""
    if hasattr(control, "options"):
        return isinstance(value, str) and value in control.options
    if isinstance(control.value, bool):
        return isinstance(value, bool)
    if isinstance(value, bool) or not isinstance(value, int | float) or not hasattr(control, "min"):
        return False
    return bool(control.min <= value <= control.max)


def _values(value: Any) -> Iterator[Any]:
    """What is in nested lists and dictionaries."""
    if isinstance(value, Mapping):
        value = tuple(value.values())
    if not isinstance(value, list | tuple):
        yield value
        return
    for one in value:
        yield from _values(one)


def _is_plain(value: Any) -> bool:
    """Whether a value is nothing, a short text or a finite number."""
    return (
        value is None
        or (isinstance(value, str) and len(value) < 200)
        or (isinstance(value, int | float) and math.isfinite(value))
    )
