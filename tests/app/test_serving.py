"""Who may open the app: the token, the cookie that it becomes, and the names of this machine."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from semgs.app.serving import COOKIE, LOCAL_HOSTS, Door, folder_page, served_path
from semgs.cli.main import main

TOKEN = "a-token"


async def behind(scope: dict[str, Any], receive: Any, send: Any) -> None:
    await send({"type": "http.response.start", "status": 200, "headers": []})


def answer(door: Door, query: str = "", kind: str = "http", **headers: str) -> dict[str, Any]:
    """The first message of the answer to a request."""
    sent: list[dict[str, Any]] = []

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    listed = [(name.encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": kind, "headers": listed, "query_string": query.encode()}
    asyncio.run(door(scope, None, send))  # type: ignore[arg-type]
    return sent[0]


def test_the_token_becomes_a_cookie_and_leaves_the_address():
    door = Door(behind, TOKEN, None)
    first = answer(door, f"token={TOKEN}&room=abc")
    headers = dict(first["headers"])
    assert (first["status"], headers[b"location"]) == (303, b"/?room=abc")
    cookie = headers[b"set-cookie"].decode()
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert answer(door, cookie=f"other=1; {COOKIE}={TOKEN}")["status"] == 200


@pytest.mark.parametrize("query", ["", "token=", "token=a-toke", "token=b&token=a-token"])
def test_without_the_token_nothing_is_served(query: str):
    assert answer(Door(behind, TOKEN, None), query)["status"] == 403
    assert answer(Door(behind, TOKEN, None), query, cookie=f"{COOKIE}=wrong")["status"] == 403


def test_without_the_token_no_websocket_opens():
    assert answer(Door(behind, TOKEN, None), f"token={TOKEN}", "websocket")["type"] == "websocket.close"


@pytest.mark.parametrize(
    ("host", "status"),
    [("127.0.0.1:7860", 200), ("localhost:7860", 200), ("[::1]:7860", 200), ("evil.example:7860", 421), ("", 421)],
)
def test_on_this_machine_only_its_own_names_open_the_app(host: str, status: int):
    assert answer(Door(behind, None, LOCAL_HOSTS), host=host)["status"] == status


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
