from __future__ import annotations

import asyncio
import socket
import threading
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from wall_and_chair import wall_and_chair
from websockets.frames import OP_BINARY, OP_CONT, OP_PING, OP_TEXT, Frame, Opcode
from websockets.protocol import State
from websockets.server import ServerProtocol

from semgs.files.errors import InputError
from semgs.viewer import server
from semgs.viewer.window import open_window

LISTEN = "0A"

SECONDS = 60
"""How long a thread may take to end."""


def listening(port: int) -> list[str]:
    """The addresses on which a port of this machine is open, from the kernel's tables."""
    found = []
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            _, local, _, state, *_ = line.split()
            address, at = local.split(":")
            if state == LISTEN and int(at, 16) == port:
                found.append(socket.inet_ntoa(bytes.fromhex(address)[::-1]) if table == "tcp" else address)
    return found


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="this system has no /proc/net/tcp")
def test_the_viewer_listens_on_this_machine_only_and_stops_at_the_end(capsys: pytest.CaptureFixture[str]):
    before = set(threading.enumerate())
    with open_window(wall_and_chair((4, 5))) as window:
        port = urlsplit(window.url).port
        assert window.url == f"http://127.0.0.1:{port}"
        assert listening(port) == ["127.0.0.1"]
        assert window._server.request_share_url() is None, "no page can ask for a public address"
    assert capsys.readouterr().out == "", "viser's own messages are not ours"
    for thread in set(threading.enumerate()) - before:
        thread.join(SECONDS)  # viser itself waits for one second
        assert not thread.is_alive(), thread
    assert listening(port) == []


def test_an_address_of_another_machine_is_refused_at_once():
    with (
        pytest.raises(InputError, match=r"192\.0\.2\.1: expected an IPv4 address of this machine"),
        open_window(wall_and_chair((4, 5)), host="192.0.2.1"),
    ):
        pass


@pytest.mark.parametrize(
    ("waiting", "ended"),
    [
        ([300_000, 300_000], True), ([300_000, 240_000], True), ([300_000, 200_000, 100_000, 60_000, 60_000], False), ([60_000, 60_000, 60_000], False),
        ([0, 300_000, 0, 300_000, 0], False), ([0, 300_000, 310_000], True),
    ],
)  # fmt: skip
def test_a_browser_that_takes_nothing_of_a_scene_is_gone(
    waiting: list[int], ended: bool, monkeypatch: pytest.MonkeyPatch
):
    """Less than 65,536 bytes between two looks, of what is more than that."""
    monkeypatch.setattr(server, "SENDING_SECONDS", 0.0)
    looks = iter(waiting)

    class Transport:
        aborted = False

        def get_write_buffer_size(self) -> int:
            return next(looks)

        def abort(self) -> None:
            self.aborted = True

    transport = Transport()
    with suppress(RuntimeError):  # there are no more looks
        asyncio.run(server._end_if_stuck(transport))  # type: ignore[arg-type]
    assert transport.aborted is ended


@pytest.mark.parametrize(
    ("frames", "taken"),
    [
        ([(OP_BINARY, b"a", True), (OP_PING, b"", True), (OP_TEXT, b"b", True)], [b"a", b"", b"b"]),
        ([(OP_BINARY, b"a", True), (OP_BINARY, b"", False), (OP_CONT, b"", False)], [b"a"]),
        ([(OP_TEXT, b"b", False), (OP_CONT, b"c", True)], []),
        ([(OP_CONT, b"c", True)], []),
    ],
    ids=["whole", "without an end", "in two parts", "an end alone"],
)
def test_messages_of_a_page_come_whole(frames: list[tuple[Opcode, bytes, bool]], taken: list[bytes]):
    """The library would keep parts of a message without end, 65 bytes for each empty one."""
    protocol = ServerProtocol(state=State.OPEN)
    server._take_no_parts(protocol)
    for opcode, content, last in frames:
        protocol.receive_data(Frame(opcode, content, fin=last).serialize(mask=True))
    received = [frame for frame in protocol.events_received() if isinstance(frame, Frame)]
    assert [bytes(frame.data) for frame in received] == taken
    assert (protocol.close_sent is None) is (len(taken) == len(frames))
