"""What a browser may send to a viewer: what its page sends, with values that the controls can have."""

from __future__ import annotations

import asyncio
import math
from types import SimpleNamespace
from typing import Any

import pytest
from wall_and_chair import wall_and_chair

from semgs.viewer.viewer_messages import _check_first, is_known, is_plain
from semgs.viewer.window import Window, open_window

messages = pytest.importorskip("viser._messages")
msgspec = pytest.importorskip("msgspec")

SLIDER = SimpleNamespace(value=0.5, min=0.0, max=1.0)
CONTROLS = {
    "box": SimpleNamespace(value=True), "slider": SLIDER, "choice": SimpleNamespace(value="a", options=("a", "b")), "text": SimpleNamespace(value="a"),
}  # fmt: skip


def known(uuid: Any, **updates: Any) -> bool:
    """Whether a control may be changed so."""
    return is_known(messages.GuiUpdateMessage(uuid, updates), CONTROLS)


def test_a_control_is_given_only_values_that_it_can_have():
    assert known("box", value=False)
    assert known("slider", value=1)
    assert known("slider", value=0.25)
    assert known("choice", value="b")
    for value in (1.01, -1, math.nan, math.inf, True, "0.5", None, [0.5]):
        assert not known("slider", value=value), value
    for value in (0, 1, "true", None, []):
        assert not known("box", value=value), value
    for value in ("c", 0, ["a"], None):
        assert not known("choice", value=value), value
    assert not known("text", value="b"), "the panel has no field for texts"


def test_nothing_but_the_value_of_a_control_of_the_panel_changes():
    assert not known("box", value=True, is_button=True)
    assert not known("box", update_cb=[])
    assert not known("box")
    assert not known("other", value=True)
    for updates in (None, ["value"], "value", 1):
        assert not is_known(messages.GuiUpdateMessage("box", updates), CONTROLS), updates
    assert not known(["box"], value=True)


def camera(**changed: Any) -> Any:
    """A message that says where a camera is."""
    usual = {
        "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 0.0), "fov": 0.8, "near": 0.01, "far": 10.0, "image_height": 480,
        "image_width": 640, "look_at": (0.0, 0.0, 1.0), "up_direction": (0.0, 0.0, 1.0),
    }  # fmt: skip
    return messages.ViewerCameraMessage(**{**usual, **changed})


def test_cameras_have_finite_numbers():
    assert is_known(camera(), CONTROLS)
    assert not is_known(camera(position=(0.0, math.nan, 0.0)), CONTROLS)
    assert not is_known(camera(fov=math.inf), CONTROLS)
    assert not is_known(camera(fov="a" * 200), CONTROLS)
    assert not is_known(camera(fov=b"a"), CONTROLS)
    for field, wrong in (
        ("fov", 0), ("fov", 3.2), ("fov", None), ("fov", True), ("wxyz", (1.0, 0.0, 0.0)), ("wxyz", [1, [2, 3]]), ("position", None), ("position", {"a": 1}),
        ("image_height", 0), ("image_width", 1e9), ("look_at", (0.0, 0.0, 1e40)), ("look_at", (True, 0.0, 1.0)), ("up_direction", 3 * ("a",)), ("near", -1.0),
    ):  # fmt: skip
        assert not is_known(camera(**{field: wrong}), CONTROLS), (field, wrong)


def test_messages_are_checked_before_viser_reads_them():
    """viser prints what does not fit its types, escape sequences included, and keeps it."""
    packed = msgspec.msgpack.encode
    usual = {**vars(camera()), "type": "ViewerCameraMessage"}
    assert is_plain(packed(usual))
    for value in (0.5, 3, True, False, "Colour"):
        assert is_plain(packed({"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": value}})), value
    ray = {"ray_origin": [0, 0, 0], "ray_direction": [0, 0, 1], "modifier": None}
    node = {"type": "SceneNodeClickMessage", "name": "/a", "instance_index": None, "owner": "", **ray}
    pointer = {"type": "ScenePointerMessage", "event_type": "click", **ray}
    assert is_plain(packed({**node, "screen_pos": [0.5, 0.5]}))
    assert is_plain(packed({**pointer, "screen_pos": [[0.5, 0.5]]}))
    for places in ([], [1.0], [[0.5, 0.5]], [0.5, 0.5, 0.5], "ab", None, [True, 0.5]):
        assert not is_plain(packed({**node, "screen_pos": places})), places
    for places in ([1.0, 2.0], [[1.0]], [[0.5, 0.5, 0.5]], 65 * [[0.5, 0.5]], "ab", None, {"a": [1, 2]}):
        assert not is_plain(packed({**pointer, "screen_pos": places})), places
    assert not is_plain(packed({**usual, "screen_pos": [0.5, 0.5]}))
    assert not is_plain(packed({**usual, "other": 1}))
    for field in ("wxyz", "fov", "type"):
        assert not is_plain(packed({name: value for name, value in usual.items() if name != field})), field
    for wrong in (
        packed({**usual, "wxyz": "\x1b[31m"}), packed({**usual, "wxyz": [1.0, 0.0, 0.0, 0.0, 0.0]}), packed({**usual, "wxyz": [0, 0, 0, 0]}),
        packed({**usual, "type": "GuiFormSubmitMessage"}), packed({**usual, "type": ["ViewerCameraMessage"]}) [:-1], packed([usual]), packed(3), b"", b"\xc1", "text", None,
        packed({"type": "GuiUpdateMessage", "uuid": "a", "updates": ["value"]}), packed({"type": "GuiUpdateMessage", "uuid": "a", "updates": {"value": "a" * 200}}),
    ):  # fmt: skip
        assert not is_plain(wrong), wrong


def test_clicks_have_a_ray_and_a_place_on_the_screen():
    ray, up = (0.0, 0.5, -1.0), (0.0, 0.0, 1.0)
    assert is_known(messages.ScenePointerMessage("click", ray, up, ((0.5, 0.5),), None), CONTROLS)
    assert is_known(messages.ScenePointerMessage("rect-select", None, None, ((0, 0), (1, 1)), None), CONTROLS)
    assert is_known(messages.SceneNodeClickMessage("/a", None, ray, up, (0.5, 0.5), None), CONTROLS)
    assert not is_known(messages.ScenePointerMessage("click", ray, [1, [2], 3], ((0.5, 0.5),), None), CONTROLS)
    assert not is_known(messages.ScenePointerMessage("click", ray, up, 100 * ((0.5, 0.5),), None), CONTROLS)
    assert not is_known(messages.ScenePointerMessage(["click"], ray, up, ((0.5, 0.5),), None), CONTROLS)


@pytest.mark.parametrize(
    "message",
    [
        messages.GuiFormDirtyMessage("a"), messages.GuiFormSubmitMessage("a"),
        messages.FileTransferStartUpload("a", "b", "c", "d", 1, 1), messages.ShareUrlRequest(), messages.RunJavascriptMessage("alert(1)"),
    ],
    ids=lambda one: type(one).__name__,
)  # fmt: skip
def test_what_the_page_does_not_send_is_left_out(message: Any):
    assert not is_known(message, CONTROLS)


def sent(window: Window, message: Any) -> None:
    """Hand the server of a viewer a message of the first browser."""
    asyncio.run(window._server._websock_server._handle_incoming_message(0, message))


def kept(window: Window) -> int:
    """How many messages the server has for browsers that connect later."""
    return len(window._server._websock_server._broadcast_buffer.message_from_id)


def test_while_work_waits_clicks_are_left_out_and_what_a_control_is_now_counts():
    taken: list[Any] = []

    class GuiButtonHandle:
        value = False

    async def take(client: int, message: Any) -> None:
        taken.append(message)

    receiver, controls = SimpleNamespace(_handle_incoming_message=take), {**CONTROLS, "button": GuiButtonHandle()}
    waiting = 7
    _check_first(receiver, controls, lambda: waiting)
    click = messages.ScenePointerMessage("click", (0, 0, 0), (0, 0, 1), ((0.5, 0.5),), None)
    press, slide = (
        messages.GuiUpdateMessage("button", {"value": True}),
        messages.GuiUpdateMessage("slider", {"value": 0.5}),
    )
    for one in (click, press, slide):
        asyncio.run(receiver._handle_incoming_message(0, one))
    waiting = 8
    for one in (click, press, slide):
        asyncio.run(receiver._handle_incoming_message(0, one))
    assert taken == [click, press, slide, slide]


def test_a_viewer_keeps_nothing_that_its_page_does_not_send():
    with open_window(wall_and_chair((4, 5))) as window:
        box, before = window._boxes["chair"], kept(window)
        for number in range(5):
            sent(window, messages.GuiFormSubmitMessage(str(number)))
            sent(window, messages.GuiUpdateMessage(box._impl.uuid, {"label": str(number)}))
        assert kept(window) == before
        sent(window, messages.GuiUpdateMessage(box._impl.uuid, {"value": False}))
        assert box.value is False
        for value in (True, False, True):
            window._tell_all("stayNear", value)
            window._tell_all("showPhotos", value)
        buffer = window._server._websock_server._broadcast_buffer.message_from_id.values()
        sources = [one.source for one in buffer if getattr(one, "source", "").startswith("semgs.s")]
        assert [one for one in sources if not one.startswith("semgs.start(")] == [
            "semgs.stayNear(true)",
            "semgs.showPhotos(true)",
        ]
