"""What the app serves of a room, and what it says before it starts."""

from __future__ import annotations

import socket
import time
from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any

import pytest

from semgs.app import serving
from semgs.app.serving import folder_page, served_path
from semgs.cli.main import main


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A room with files that are served, and others that are not."""
    folder = tmp_path / "room"
    (folder / "renders").mkdir(parents=True)
    (folder / "renders" / "a #1 <b>.png").touch()
    (folder / ".semgs").touch()
    (folder / "report.html").touch()
    (tmp_path / "secret").touch()
    return folder


@pytest.mark.parametrize("name", ["report.html", "renders/", "renders/a #1 <b>.png"])
def test_what_a_report_links_to_is_served(room: Path, name: str):
    assert served_path(room, name) == room / name


@pytest.mark.parametrize(
    "name",
    ["", "/", "renders", ".semgs", "../secret", "../", "renders/../../secret", "absent/", "absent", "a\0b", 300 * "x"],
)
def test_nothing_else_is_served(room: Path, name: str):
    assert served_path(room, name) is None


def test_a_folder_of_a_room_is_a_page_of_links(room: Path):
    assert '<li><a href="a%20%231%20%3Cb%3E.png">a #1 &lt;b&gt;.png</a></li>' in folder_page(room / "renders")


@pytest.mark.parametrize("option", ["--segmenter", "--depth"])
def test_a_source_that_is_not_there_is_told_before_the_app_starts(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = tmp_path / "a.onnx"
    assert main(["app", "--folder", str(tmp_path / "app"), option, str(missing)]) == 2
    assert capsys.readouterr().err == (
        f"semgs: error: {missing}: expected an exported network (.onnx, .tflite), a model folder of transformers, or hf:OWNER/NAME, found nothing there\n"
    )
    assert not (tmp_path / "app").exists()


LARGE = 2 << 20


def port_of_a_server() -> int:
    """The port of a server that answers with `LARGE` bytes; it lives as long as the tests."""
    pytest.importorskip("uvicorn", reason="uvicorn is not installed; pip install '.[app]' in SemGS's folder")

    async def app(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": [(b"connection", b"close")]})
        await send({"type": "http.response.body", "body": bytes(LARGE)})

    ports: Queue[int] = Queue()
    Thread(target=serving.serve, args=(app, "127.0.0.1", 0, ports.put), daemon=True).start()
    return ports.get(timeout=30)


def taken(chunks: int, seconds: float) -> int:
    """How many of `LARGE` bytes a browser gets that reads 64 KiB so many times, and waits so long [s] before each."""
    port = port_of_a_server()
    with socket.socket() as browser:
        browser.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 65536)
        browser.connect(("127.0.0.1", port))
        browser.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        size = 0
        try:
            for _ in range(chunks):
                time.sleep(seconds)
                size += len(browser.recv(65536, socket.MSG_WAITALL))
        except ConnectionError:
            pass
        return size


def test_a_slow_browser_gets_all_of_an_answer_and_one_that_takes_nothing_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """64 KiB each 0.05 s take 1.7 s, four times the limit for 64 KiB. After 0.8 s without a read, at most what lies in both systems' buffers is left."""
    monkeypatch.setattr(serving, "SENDING_SECONDS", 0.4)
    assert taken(34, 0.05) > LARGE
    assert taken(2, 0.8) < LARGE / 4


def test_of_connections_that_ask_for_nothing_few_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four of seven end at once; an eighth is answered after one of the three has gone."""
    monkeypatch.setattr(serving, "SOCKETS", 3)
    port = port_of_a_server()
    silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(7)]
    time.sleep(1)
    ended = 0
    for one in silent:
        one.setblocking(False)
        try:
            ended += one.recv(1) == b""
        except ConnectionError:
            ended += 1
        except BlockingIOError:
            pass
    assert ended == 4
    for one in silent:
        one.close()
    time.sleep(0.5)
    with socket.create_connection(("127.0.0.1", port)) as browser:
        browser.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert browser.recv(12) == b"HTTP/1.1 200"


def test_a_server_has_the_descriptors_that_it_needs_if_the_system_gives_them(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource")
    given: list[Any] = []
    monkeypatch.setattr(resource, "setrlimit", lambda _, limits: given.append(limits))
    for limits, has, asked in (
        ((256, 4096), 900, [(900, 4096)]), ((256, 500), 500, [(500, 500)]), ((1024, 4096), 1024, []), ((256, resource.RLIM_INFINITY), 900, [(900, resource.RLIM_INFINITY)]),
    ):  # fmt: skip
        monkeypatch.setattr(resource, "getrlimit", lambda _, limits=limits: limits)
        given.clear()
        assert (serving.allow_descriptors(900), given) == (has, asked)
