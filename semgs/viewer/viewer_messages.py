"""What a browser may send to a viewer: the few messages of its page, with values that the controls can have. viser itself takes more, for pages of other programs, and keeps it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from semgs.viewer.failures import tell_failure

MOST_BYTES = 64 * 1024
"""Longest message of a browser. Those of the page have less than a kilobyte."""

CONTROL = "GuiUpdateMessage"
VECTORS = {"wxyz": 4, "position": 3, "look_at": 3, "up_direction": 3, "ray_origin": 3, "ray_direction": 3}
"""Fields that are lists of so many numbers."""

DIRECTIONS = ("wxyz", "up_direction", "ray_direction")
"""Those that are not all zeros."""

POSITIVE = {"fov": math.pi, "near": 1e30, "far": 1e30, "image_height": 1e5, "image_width": 1e5}
"""Fields that are numbers above 0 and below these."""

LARGEST, MOST_POINTS = 1e30, 64
"""Of all numbers, and of the places on the screen of a click."""

MOST_WAITING, THREADS = 8, 4
"""Clicks and presses of buttons are left out while so much work of browsers waits; it is done by so many threads."""

CAMERA, POINTER, NODE_CLICK = "ViewerCameraMessage", "ScenePointerMessage", "SceneNodeClickMessage"
_RAY = ("ray_origin", "ray_direction", "screen_pos", "modifier")
FIELDS = {
    CAMERA: ("wxyz", "position", "fov", "near", "far", "image_height", "image_width", "look_at", "up_direction"),
    POINTER: ("event_type", *_RAY),
    NODE_CLICK: ("name", "instance_index", "owner", *_RAY),
}
"""What those without a control hold."""

TAKEN = (CONTROL, *FIELDS)
"""Types of messages that the page needs: a control was used, the camera moved, and clicks."""


def take_known_messages(server: Any) -> None:
    """From now on, a server leaves out messages that its page does not send.

    Args:
        server: of viser, before a browser has connected.
    """
    controls = server.gui._gui_input_handle_from_uuid
    receivers, threads = server._websock_server, server._thread_executor
    threads._max_workers = THREADS  # they wait for one another anyway
    waiting = threads._work_queue.qsize
    _check_first(receivers, controls, waiting)
    receivers.on_client_connect(lambda connection: _check_first(connection, controls, waiting))


def is_plain(raw: object) -> bool:
    """Whether what a browser sent is one of the page's messages by its form. viser warns of others with all that is in them, and keeps the warning.

    Args:
        raw: as received.
    """
    from msgspec import DecodeError, msgpack

    if not isinstance(raw, bytes):
        return False
    try:
        fields = msgpack.decode(raw)
    except (DecodeError, ValueError, RecursionError):
        return False
    if not isinstance(fields, dict) or fields.get("type") not in TAKEN:
        return False
    kind = fields.pop("type")
    if kind != CONTROL:
        return _is_of_kind(kind, fields)
    updates = fields.get("updates")
    if set(fields) != {"uuid", "updates"} or not isinstance(updates, dict) or set(updates) != {"value"}:
        return False
    return isinstance(updates["value"], bool) or _has_shape("value", updates["value"])


def is_known(message: Any, controls: Mapping[str, Any]) -> bool:
    """Whether a message is one of the page's.

    Args:
        message: of viser.
        controls: those of the panel, by identifier.
    """
    if type(message).__name__ not in TAKEN:
        return False
    if type(message).__name__ != CONTROL:
        return _is_of_kind(type(message).__name__, vars(message))
    control = controls.get(message.uuid) if isinstance(message.uuid, str) else None
    updates = message.updates
    known = control is not None and isinstance(updates, dict) and set(updates) == {"value"}
    return known and _fits(updates["value"], control)


def _check_first(receiver: Any, controls: Mapping[str, Any], waiting: Callable[[], int]) -> None:
    """Hand only known messages to what takes them."""
    take = receiver._handle_incoming_message

    async def checked(client: int, message: Any) -> None:
        try:
            if is_known(message, controls) and not (waiting() >= MOST_WAITING and _is_press(message, controls)):
                await take(client, message)
        except Exception as error:
            tell_failure(error)

    receiver._handle_incoming_message = checked


def _is_press(message: Any, controls: Mapping[str, Any]) -> bool:
    """Whether a message is a click or the press of a button: others say what a control is now, and the last of them counts."""
    kind = type(message).__name__
    return kind in (POINTER, NODE_CLICK) or (
        kind == CONTROL and type(controls.get(message.uuid)).__name__.startswith("GuiButton")
    )


def _fits(value: Any, control: Any) -> bool:
    """Whether a control can have a value."""
    if hasattr(control, "options"):
        return isinstance(value, str) and value in control.options
    if isinstance(control.value, bool):
        return isinstance(value, bool)
    if not _is_number(value) or not hasattr(control, "min"):
        return False
    if isinstance(control.value, int) and not isinstance(value, int):
        return False
    return bool(control.min <= value <= control.max)


def _is_of_kind(kind: str, fields: Mapping[Any, Any]) -> bool:
    """Whether a message has the fields of its kind, with values as the page sends them."""
    if {*fields, "owner"} != {*FIELDS[kind], "owner"} or (kind != NODE_CLICK and "owner" in fields):
        return False
    places = fields.get("screen_pos", ())
    pairs = (places,) if kind == NODE_CLICK else places
    if kind != CAMERA and not (_is_list(pairs) and len(pairs) <= MOST_POINTS and all(map(_is_pair, pairs))):
        return False
    return all(name == "screen_pos" or _has_shape(name, value) for name, value in fields.items())


def _is_pair(value: Any) -> bool:
    """Whether a value is a place on the screen."""
    return _is_list(value, 2) and all(map(_is_number, value))


def _has_shape(name: str, value: Any) -> bool:
    """Whether a field of a message has a value as the page sends it."""
    if name in VECTORS:
        if value is None:
            return name.startswith("ray")
        numbers = _is_list(value, VECTORS[name]) and all(map(_is_number, value))
        return numbers and (name not in DIRECTIONS or any(value))
    if name in POSITIVE:
        return _is_number(value) and 0 < value < POSITIVE[name]
    return value is None or _is_number(value) or (isinstance(value, str) and len(value) < 200)


def _is_list(value: Any, length: int | None = None) -> bool:
    """Whether a value is a list, of a length if one is given."""
    return isinstance(value, list | tuple) and length in (None, len(value))


def _is_number(value: Any) -> bool:
    """Whether a value is a finite number, and not true or false."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < LARGEST
