"""What gets through to gradio: the routes that the page uses, calls with uploaded files alone, and uploads that fit. None of it needs gradio."""

from __future__ import annotations

import asyncio
import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from semgs.app import door
from semgs.app.door import BUSY, FULL, JOIN, PROGRESS, STREAM, UPLOAD, Door, checked_call, inside, is_known, is_plain
from semgs.app.limits import Limits
from semgs.app.uploads import GONE, UnusableUploadError
from semgs.viewer import failures
from semgs.viewer.access import Access

SECRET = "the secret of this machine"

LIMITS = Limits(total_bytes=1000, uploads=4, uploads_bytes=1500)

CALL = {"fn_index": 0, "session_hash": "a1", "data": [[], 2, "words"], "event_data": None, "trigger_id": 6}


FORM = "multipart/form-data; boundary=----WebKitFormBoundaryA1b2C3d4E5f6G7h8"


class Behind:
    """In gradio's place: reads bodies, and remembers what got through."""

    def __init__(self) -> None:
        self.bodies: list[bytes] = []
        self.queries: list[bytes] = []

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        body, more = b"", scope["method"] == "POST"
        while more:
            message = await receive()
            body, more = body + message["body"], message["more_body"]
        self.bodies.append(body)
        self.queries.append(scope["query_string"])
        if scope["path"] == "/theme.css":
            raise RuntimeError("a failure\nof gradio")
        headers = [(b"content-type", b"text/html"), (b"referrer-policy", b"unsafe-url")]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": b""})


def answer(
    uploads: Path,
    path: str,
    parts: Sequence[bytes] = (b"",),
    method: str = "POST",
    length: int | None = None,
    limits: Limits = LIMITS,
    query: str = "",
    behind: Behind | None = None,
    **more: Any,
) -> tuple[int, str, list[bytes], dict[str, str]]:
    """The status and text of an answer, the bodies that got through, and the headers."""
    behind, sent = behind or Behind(), list[Any]()
    waiting = [
        {"type": "http.request", "body": part, "more_body": number + 1 < len(parts)}
        for number, part in enumerate(parts)
    ]

    async def receive() -> Any:
        if not waiting:
            await asyncio.sleep(60)
        return waiting.pop(0)

    async def send(message: Any) -> None:
        sent.append(message)

    headers = {
        "host": "127.0.0.1:80",
        "content_type": FORM,
        **({} if length is None else {"content-length": str(length)}),
        **more,
    }
    listed = [(name.replace("_", "-").encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "method": method, "path": path, "headers": listed, "query_string": query.encode()}
    asyncio.run(Door(behind, Access(), uploads, limits, [3])(scope, receive, send))
    told = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
    return sent[0]["status"], sent[-1]["body"].decode(), behind.bodies, told


async def posted(uploads: Path, path: str, receive: Any, behind: Any = None, method: str = "POST") -> list[Any]:
    """The messages that answer a request whose body comes from `receive`."""
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {
        "type": "http",
        "method": method,
        "path": path,
        "headers": [(b"host", b"localhost"), (b"content-type", FORM.encode())],
        "query_string": b"",
    }
    await Door(behind or Behind(), Access(), uploads, LIMITS, [3])(scope, receive, send)
    return sent


@pytest.fixture
def uploads(tmp_path: Path) -> Path:
    """A folder of uploads with one file, beside a file of this machine."""
    (tmp_path / "secret.jpg").write_text(SECRET)
    (tmp_path / "uploads" / "abc").mkdir(parents=True)
    (tmp_path / "uploads" / "abc" / "a.jpg").write_bytes(b"photo")
    return tmp_path / "uploads"


def file(path: Path | str, **more: Any) -> dict[str, Any]:
    """A file as gradio's client writes it."""
    return {"path": str(path), "orig_name": "a.jpg", "meta": {"_type": "gradio.FileData"}, **more}


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/"), ("HEAD", "/"), ("GET", "/assets/index-3o3U-0UB.js"), ("GET", "/static/js/iframeResizer.contentWindow.min.js"), ("GET", "/theme.css"),
        ("GET", "/favicon.ico"), ("GET", "/gradio_api/queue/data"), ("GET", "/gradio_api/upload_progress"), ("POST", JOIN), ("POST", UPLOAD),
        ("GET", "/rooms/0123456789abcdefghij/renders/a b.png"),
    ],
)  # fmt: skip
def test_what_the_page_uses_is_there(method: str, path: str):
    assert is_known(method, path)


@pytest.mark.parametrize(
    ("method", "path"),
    [
        ("GET", "/gradio_api/deep_link"), ("GET", "/gradio_api/file=/etc/passwd"), ("GET", "/gradio_api/file/etc/passwd"), ("GET", "/gradio_api/proxy=http://a"),
        ("GET", "/gradio_api/openapi.json"), ("GET", "/gradio_api/info"), ("GET", "/monitoring"), ("GET", "/monitoring/summary"), ("GET", "/config"),
        ("POST", "/gradio_api/run/predict"), ("POST", "/gradio_api/call/start"), ("POST", "/gradio_api/stream/x"), ("POST", "/gradio_api/vibe-code"),
        ("GET", JOIN), ("PUT", UPLOAD), ("OPTIONS", UPLOAD), ("DELETE", "/"), ("POST", "/"), ("GET", JOIN + "/"), ("GET", "//"), ("GET", "/assets/"),
        ("GET", "/assets/../../etc/passwd"), ("GET", "/assets/..\\a"), ("GET", "/assets/a\0"), ("GET", "/static/a/../b"), ("GET", "/custom_component/a/b/c/d"),
        ("GET", "/rooms/short/index.html"), ("GET", "/rooms/0123456789abcdefghij/../../secret"), ("GET", "/theme.css\n"), ("GET", "/docs"), ("GET", "/theme/css"),
    ],
)  # fmt: skip
def test_nothing_else_is_there(uploads: Path, method: str, path: str):
    assert not is_known(method, path)
    status, text, bodies, _ = answer(uploads, path, method=method)
    assert (status, text, bodies) == (404, "There is no such page.", [])


def test_a_page_elsewhere_uploads_nothing(uploads: Path):
    for headers in (
        {"origin": "https://evil.example"},
        {"origin": "http://127.0.0.1:81"},
        {"sec_fetch_site": "cross-site"},
    ):
        status, _, bodies, _ = answer(uploads, UPLOAD, [b"x"], length=1, **headers)
        assert (status, bodies) == (403, [])
    assert answer(uploads, UPLOAD, [b"x"], length=1, origin="http://127.0.0.1:80")[2] == [b"x"]


def test_a_call_with_an_uploaded_file_goes_through_without_what_it_does_not_need(uploads: Path):
    path = uploads / "abc" / "a.jpg"
    body = {
        **CALL,
        "data": [[file(path, url="http://127.0.0.1/x", is_stream=True)], 2, "words"],
        "event_data": file("/etc/passwd"),
        "extra": 1,
    }
    _, _, bodies, _ = answer(uploads, JOIN, [json.dumps(body).encode()])
    assert json.loads(bodies[0]) == {**CALL, "data": [[file(path)], 2, "words"]}


@pytest.mark.parametrize(
    ("query", "kept"),
    [
        ("", b""), ("room=a1b2", b"room=a1b2"), ("__theme=dark&room=a1&x=%00", b"room=a1"), ("room=", b""), ("room=../a", b""), (f"room={41 * 'a'}", b""),
        ("xroom=a1", b""), ("x=room=a1", b""), ("room=a1&room=b2", b"room=a1"),
    ],
)  # fmt: skip
def test_of_the_pages_address_a_call_keeps_the_room(uploads: Path, query: str, kept: bytes):
    """gradio adds the query of the page's address to each call: a page of a room that is loaded again asks for that room so."""
    behind = Behind()
    assert answer(uploads, JOIN, [json.dumps(CALL).encode()], query=query, behind=behind)[0] == 200
    assert answer(uploads, "/", method="GET", query=query, behind=behind)[0] == 200
    assert behind.queries == [kept, kept]


@pytest.mark.parametrize(
    "kind",
    [
        "", "text/plain", "multipart/form-data", "multipart/form-data; boundary=", "multipart/form-data; boundary=a; charset=utf-16", "multipart/mixed; boundary=a",
        "multipart/form-data; charset=rot13; boundary=a", f"multipart/form-data; boundary={71 * 'a'}", 'multipart/form-data; boundary="a;b"',
    ],
)  # fmt: skip
def test_uploads_are_forms_as_browsers_send_them(uploads: Path, kind: str):
    """gradio would decode the names of files as any character set that a request names."""
    assert answer(uploads, UPLOAD, [b"x"], content_type=kind)[::2] == (400, [])
    assert answer(uploads, UPLOAD, [b"x"], content_type="multipart/form-data; boundary=--a'()+_,./:=?-1")[2] == [b"x"]


OUTSIDE = (
    "/etc/passwd", "/proc/self/environ", "/dev/zero", "/dev/stdin", "{uploads}/../secret.jpg", "{uploads}/abc/../../secret.jpg", "{uploads}", "{uploads}/abc", ".", "",
    "../secret.jpg", "a.jpg", "~", "file:///etc/passwd", "http://127.0.0.1:80/", "{uploads}/link.jpg", "{uploads}/folder/secret.jpg", "{uploads}/pipe.jpg",
    "{uploads}/absent.jpg", "{uploads}/a\0.jpg", "{uploads}/" + 5000 * "x", "{uploads}2/secret.jpg", "/proc/self/root/etc/passwd", "{uploads}/loop",
)  # fmt: skip


@pytest.mark.parametrize("path", OUTSIDE)
def test_a_file_that_nobody_uploaded_is_refused_in_every_place(uploads: Path, path: str):
    (uploads / "link.jpg").symlink_to(uploads.parent / "secret.jpg")
    (uploads / "folder").symlink_to(uploads.parent)
    (uploads / "loop").symlink_to(uploads / "loop")
    os.mkfifo(uploads / "pipe.jpg")
    (uploads.parent / "uploads2").mkdir()
    (uploads.parent / "uploads2" / "secret.jpg").write_text(SECRET)
    named = path.format(uploads=uploads)
    assert not inside(Path(named), uploads)
    for data in (
        [[file(named)], 2, "w"],
        [[file(uploads / "abc/a.jpg"), file(named)], 2, "w"],
        [[], [file(named)], "w"],
    ):
        status, text, bodies, _ = answer(uploads, JOIN, [json.dumps({**CALL, "data": data}).encode()])
        assert (status, text, bodies) == (400, GONE, []), data


@pytest.mark.parametrize(
    "change",
    [
        {"fn_index": 1}, {"fn_index": -1}, {"fn_index": True}, {"fn_index": "0"}, {"fn_index": None}, {"fn_index": 10**30}, {"data": None}, {"data": []},
        {"data": [[], 2, "w", 4]}, {"data": [[], 2, {"path": "/etc/passwd"}]}, {"data": [file("/etc/passwd"), 2, "w"]}, {"data": [[[file("/etc/passwd")]], 2, "w"]},
        {"data": [[{"path": 3}], 2, "w"]}, {"data": [["/etc/passwd"], 2, "w"]}, {"session_hash": None}, {"session_hash": "../a"}, {"session_hash": 41 * "a"},
        {"session_hash": ["a"]}, {"trigger_id": "6"}, {"trigger_id": [6]},
    ],
)  # fmt: skip
def test_a_call_of_another_form_is_refused(uploads: Path, change: dict[str, Any]):
    status, text, bodies, _ = answer(uploads, JOIN, [json.dumps({**CALL, **change}).encode()])
    assert (status, text, bodies) == (400, "This is not a request of the page.", [])


@pytest.mark.parametrize(
    "body",
    [b"", b"[]", b"null", b'"a"', b"{", b"\xff\xfe", b'{"data": [], "data": []}', b"[" * 100_000, b'{"fn_index": NaN}'],
)
def test_a_call_that_is_no_json_object_is_refused(uploads: Path, body: bytes):
    assert answer(uploads, JOIN, [body])[0] == 400


def test_a_call_is_read_up_to_a_limit(uploads: Path):
    status, _, bodies, _ = answer(uploads, JOIN, [b" " * 200_000, b" " * 200_000, json.dumps(CALL).encode()])
    assert (status, bodies) == (413, [])


def test_checked_calls_name_the_resolved_file(uploads: Path, tmp_path: Path):
    (tmp_path / "other name").symlink_to(uploads)
    checked = checked_call({**CALL, "data": [[file(tmp_path / "other name/abc/a.jpg")], 2, ""]}, [3], uploads)
    assert checked["data"][0][0]["path"] == str(uploads.resolve() / "abc" / "a.jpg")
    with pytest.raises(UnusableUploadError):
        checked_call({**CALL, "data": [[file(tmp_path / "secret.jpg")], 2, ""]}, [3], uploads)


def test_uploads_end_at_the_limit_of_a_request_whatever_they_announce(uploads: Path):
    assert answer(uploads, UPLOAD, [b"x" * 1000], length=1000)[0] == 200
    assert answer(uploads, UPLOAD, [b"x"], length=1001)[:2] == (413, "These files are too large.")
    assert answer(uploads, UPLOAD, [b"x" * 11], length=10)[0] == 413
    assert answer(uploads, UPLOAD, [b"x" * 600, b"x" * 401])[0] == 413  # in chunks, without a length
    assert answer(uploads, UPLOAD, [b"x" * 600, b"x" * 400])[0] == 200


def test_uploads_end_where_the_folder_is_full(uploads: Path):
    (uploads / "partial").write_bytes(bytes(495))  # with the photo of 5 bytes, 500 of 1,500
    assert answer(uploads, UPLOAD, [b"x"], length=1000)[0] == 200
    (uploads / "more").write_bytes(b"x")
    assert answer(uploads, UPLOAD, [b"x"], length=1000)[:2] == (507, FULL)
    (uploads / "fourth").touch()
    assert answer(uploads, UPLOAD, [b"x"], length=1)[:2] == (507, FULL)  # four files


def test_in_a_full_folder_uploads_that_wait_for_minutes_make_place(uploads: Path):
    for number, minutes in enumerate((6, 20, 1)):
        (uploads / f"{number}").mkdir()
        (uploads / f"{number}" / "b.jpg").write_bytes(bytes(300))
        changed = time.time() - 60 * minutes
        os.utime(uploads / f"{number}" / "b.jpg", (changed, changed))
    assert answer(uploads, UPLOAD, [b"x"], length=700)[0] == 200  # 905 of 1,500 bytes and four files: the oldest goes
    assert sorted(path.name for path in uploads.iterdir()) == ["0", "2", "abc"]
    assert answer(uploads, UPLOAD, [b"x"], length=900)[0] == 200  # 605 bytes are 5 too many
    assert sorted(path.name for path in uploads.iterdir()) == ["2", "abc"]
    (uploads / "2" / "c.jpg").write_bytes(bytes(300))
    assert answer(uploads, UPLOAD, [b"x"], length=900)[:2] == (507, FULL)


def test_uploads_that_do_not_arrive_keep_no_place(uploads: Path):
    async def begun_and_another() -> int:
        gate, sent = Door(Behind(), Access(), uploads, LIMITS), list[Any]()

        async def asked(receive: Any) -> None:
            async def send(message: Any) -> None:
                sent.append(message)

            headers = [(b"host", b"127.0.0.1"), (b"content-type", FORM.encode()), (b"content-length", b"1000")]
            scope = {"type": "http", "method": "POST", "path": UPLOAD, "headers": headers, "query_string": b""}
            await gate(scope, receive, send)

        async def never() -> Any:
            await asyncio.sleep(60)

        async def at_once() -> Any:
            return {"type": "http.request", "body": bytes(1000), "more_body": False}

        idle = [asyncio.create_task(asked(never)) for _ in range(5)]
        await asyncio.sleep(0)
        await asked(at_once)
        for one in idle:
            one.cancel()
        return int(sent[0]["status"])

    assert asyncio.run(begun_and_another()) == 200


def test_uploads_that_fill_the_folder_together_end(uploads: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(door, "MEASURED_BYTES", 500)
    (uploads / "others").write_bytes(bytes(1495))  # with the photo, all that fits; they came meanwhile
    monkeypatch.setattr(door, "delete_oldest", lambda *_: True)  # there was place when it began
    parts = [b"x" * 300] * 3
    assert answer(uploads, UPLOAD, parts, length=900)[0] == 200
    (uploads / "last").write_bytes(b"x")
    assert answer(uploads, UPLOAD, parts, length=900)[:2] == (507, FULL)


def test_bodies_that_do_not_come_are_given_up(uploads: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(door, "BODY_SECONDS", 0.05)

    async def never() -> Any:
        await asyncio.sleep(60)

    for path in (JOIN, UPLOAD):
        assert asyncio.run(posted(uploads, path, never))[0]["status"] == 408


def test_bodies_that_come_too_slowly_are_given_up(uploads: Path, monkeypatch: pytest.MonkeyPatch):
    """20 bytes each 0.2 s: of one byte each 0.05 s, the fifth comes too late, and of 100 bytes each 0.05 s none; 500 at first earn no slow end."""
    monkeypatch.setattr(door, "BODY_SECONDS", 0.2)
    monkeypatch.setattr(door, "BODY_BYTES", 100)

    def status(part: bytes, first: bytes = b"") -> int:
        left = 9

        async def slowly() -> Any:
            nonlocal left
            left -= 1
            await asyncio.sleep(0.05)
            return {"type": "http.request", "body": first if first and left == 8 else part, "more_body": left > 0}

        return int(asyncio.run(posted(uploads, UPLOAD, slowly))[0]["status"])

    assert status(b"x") == 408
    assert status(b"x", first=bytes(500)) == 408
    assert status(bytes(100)) == 200


@pytest.mark.parametrize(
    ("path", "query", "plain"),
    [
        ("/gradio_api/upload_progress", "upload_id=a1b2", True), (UPLOAD, "upload_id=a1b2", True), (UPLOAD, "", True),
        ("/gradio_api/queue/data", "session_hash=a1", True), ("/", "room=a&__theme=dark", True), ("/assets/a.js", "x=1", True),
        ("/gradio_api/upload_progress", f"upload_id={41 * 'a'}", False), ("/gradio_api/upload_progress", "upload_id=", False),
        ("/gradio_api/upload_progress", "upload_id=a&upload_id=b", False), ("/gradio_api/upload_progress", "session_hash=a", False),
        ("/gradio_api/upload_progress", "upload_id=%0a", False), ("/gradio_api/queue/data", "session_hash=A", False),
        ("/gradio_api/queue/data", 9 * "&", False),
    ],
)  # fmt: skip
def test_gradio_is_given_short_words_that_the_page_sends(path: str, query: str, plain: bool):
    assert is_plain(path, query) is plain


@pytest.mark.parametrize(
    ("path", "expected"),
    [("/", 200), (f"/rooms/{20 * 'a'}/index.html", 200), ("/gradio_api/queue/data", 403), ("/theme.css", 403)],
)
def test_links_from_elsewhere_lead_to_the_page_and_to_rooms(uploads: Path, path: str, expected: int):
    foreign = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate"}
    assert answer(uploads, path, method="GET", **foreign)[0] == expected


def test_a_call_names_few_files_each_once_and_short_texts(uploads: Path):
    """gradio keeps something for each of them."""
    one = file(uploads / "abc" / "a.jpg")
    (uploads / "abc" / "b.jpg").write_bytes(b"photo")
    other = file(uploads / "abc" / "b.jpg")
    assert len(checked_call({**CALL, "data": [[one, other], 2, "a" * 1000]}, [3], uploads, 2)["data"][0]) == 2
    for data in ([[one, one], 2, ""], [[one, other, one], 2, ""], [[one] * 3, 2, ""], [[one], 2, "a" * 1001]):
        with pytest.raises(ValueError, match="not a request of the page"):
            checked_call({**CALL, "data": data}, [3], uploads, 2)
    with pytest.raises(ValueError, match="not a request of the page"):
        checked_call({**CALL, "data": [[one, other], 2, ""]}, [3], uploads, 1)


def test_the_answer_to_an_upload_says_where_the_file_is_in_the_folder_alone(uploads: Path):
    async def behind(scope: Any, receive: Any, send: Any) -> None:
        await receive()
        body = json.dumps([str(uploads / "abc" / "a.jpg")]).encode()
        await send(
            {"type": "http.response.start", "status": 200, "headers": [(b"content-length", str(len(body)).encode())]}
        )
        await send({"type": "http.response.body", "body": body[:9], "more_body": True})
        await send({"type": "http.response.body", "body": body[9:]})

    async def receive() -> Any:
        return {"type": "http.request", "body": b"", "more_body": False}

    sent = asyncio.run(posted(uploads, UPLOAD, receive, behind))
    assert sent[1]["body"] == b'["abc/a.jpg"]'
    assert dict(sent[0]["headers"])[b"content-length"] == b"13"
    assert checked_call({**CALL, "data": [[file("abc/a.jpg")], 2, ""]}, [3], uploads)["data"][0][0]["path"] == str(
        uploads / "abc" / "a.jpg"
    )
    with pytest.raises(UnusableUploadError):
        checked_call({**CALL, "data": [[file("../secret.jpg")], 2, ""]}, [3], uploads)


def test_pages_say_what_they_may_load_and_who_may_frame_them(uploads: Path):
    headers = answer(uploads, "/", method="GET")[3]
    policy = headers["content-security-policy"]
    assert "default-src 'self' data: blob:;" in policy
    assert policy.endswith("frame-ancestors 'self'")
    assert (headers["x-content-type-options"], headers["referrer-policy"]) == ("nosniff", "same-origin")


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ("/user/me/proxy/7860", "/user/me/proxy/7860"),
        ("/a/", "/a"),
        ("", ""),
        ("//evil.example", ""),
        ("a", ""),
        ("/a?b", ""),
        ("/<script>", ""),
    ],
)
def test_a_proxy_says_below_which_path_it_has_the_page(uploads: Path, given: str, expected: str):
    seen: list[Any] = []

    async def behind(scope: Any, receive: Any, send: Any) -> None:
        seen.append(scope)

    headers = {
        "host": "127.0.0.1",
        "x-forwarded-prefix": given,
        "x-forwarded-host": "evil.example",
        "x-gradio-server": "http://evil.example",
    }
    listed = [(name.encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "method": "GET", "path": "/", "headers": listed, "query_string": b""}
    asyncio.run(Door(behind, Access(), uploads, LIMITS)(scope, None, None))  # type: ignore[arg-type]
    assert seen[0]["root_path"] == expected
    assert [name for name, _ in seen[0]["headers"]] == [
        b"host",
        b"x-forwarded-prefix",
    ]  # no other name gets into the page


def test_of_a_header_that_was_sent_twice_no_value_counts(uploads: Path):
    """gradio reads the first value; the last one is a name of the server."""
    seen: list[Any] = []

    async def behind(scope: Any, receive: Any, send: Any) -> None:
        seen.append(scope)

    names = (b"evil.example", b"127.0.0.1")
    headers = [
        (b"host", b"127.0.0.1"),
        *((b"x-forwarded-host", name) for name in names),
        *((b"x-forwarded-prefix", name) for name in (b"/a", b"/b")),
    ]
    scope = {"type": "http", "method": "GET", "path": "/", "headers": headers, "query_string": b""}
    asyncio.run(Door(behind, Access(), uploads, LIMITS)(scope, None, None))  # type: ignore[arg-type]
    assert b"x-forwarded-host" not in dict(seen[0]["headers"])
    assert seen[0]["root_path"] == ""
    once = {**scope, "headers": [(b"host", b"127.0.0.1"), (b"x-forwarded-host", b"127.0.0.1")]}
    asyncio.run(Door(behind, Access(), uploads, LIMITS)(once, None, None))  # type: ignore[arg-type]
    assert dict(seen[1]["headers"])[b"x-forwarded-host"] == b"127.0.0.1"


@pytest.mark.parametrize(
    "prefix", ["/rooms", f"/rooms/{20 * 'a'}", f"/rooms/{20 * 'a'}/", f"/rooms/{20 * 'a'}/gradio_api/file=a"]
)
def test_no_proxy_makes_another_path_of_one_that_is_known(uploads: Path, prefix: str):
    seen: list[Any] = []

    async def behind(scope: Any, receive: Any, send: Any) -> None:
        seen.append(scope)

    headers = [(b"host", b"127.0.0.1"), (b"x-forwarded-prefix", prefix.encode())]
    path = f"/rooms/{20 * 'a'}/gradio_api/file=a"
    scope = {"type": "http", "method": "GET", "path": path, "headers": headers, "query_string": b""}
    asyncio.run(Door(behind, Access(), uploads, LIMITS)(scope, None, None))  # type: ignore[arg-type]
    assert (seen[0]["path"], seen[0]["root_path"]) == (path, "")


def test_a_failure_is_one_line_in_the_terminal_and_a_sentence_in_the_browser(
    uploads: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(failures, "_told", {})
    status, text, _, _ = answer(uploads, "/theme.css", method="GET")
    assert (status, text) == (500, "This request could not be answered.")
    error = capsys.readouterr().err
    assert error.startswith("semgs: a request failed: RuntimeError at test_door.py:")
    assert error.endswith(": a failure of gradio\n")
    assert error.count("\n") == 1
    answer(uploads, "/theme.css", method="GET")
    assert capsys.readouterr().err == "", "the same again fills no terminal"
    monkeypatch.setattr(failures, "QUIET_SECONDS", 0.0)
    answer(uploads, "/theme.css", method="GET")
    assert capsys.readouterr().err == error


def test_no_websocket_is_let_in(uploads: Path):
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {"type": "websocket", "path": "/", "headers": [(b"host", b"localhost")], "query_string": b""}
    asyncio.run(Door(Behind(), Access(), uploads, LIMITS, [3])(scope, None, send))  # type: ignore[arg-type]
    assert sent == [{"type": "websocket.close", "code": 1008}]


def test_a_file_of_a_room_is_sent_within_an_hour(uploads: Path, monkeypatch: pytest.MonkeyPatch):
    """While it is sent, it takes its place on the disk, though its room may be deleted."""
    assert door.DOWNLOAD_SECONDS == 3600
    monkeypatch.setattr(door, "DOWNLOAD_SECONDS", 0.01)
    ended = []

    class Slow(Behind):
        async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
            await send({"type": "http.response.start", "status": 200, "headers": []})
            try:
                await asyncio.sleep(60)
            finally:
                ended.append(scope["path"])

    path = f"/rooms/{20 * 'a'}/room.zip"
    sent = asyncio.run(posted(uploads, path, None, Slow(), "GET"))
    assert [message["type"] for message in sent] == ["http.response.start"]
    assert ended == [path]


def test_few_answers_that_last_are_open_at_once_and_few_of_one_page(
    uploads: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """gradio never ends those of an upload that was broken off, nor all but one of a page."""
    monkeypatch.setattr(door, "MOST_STREAMS", 4)

    async def asked(wanted: Sequence[tuple[str, str]]) -> list[int]:
        let_go = asyncio.Event()

        async def lasting(scope: Any, receive: Any, send: Any) -> None:
            await let_go.wait()
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": b""})

        gate, sent = Door(lasting, Access(), uploads, LIMITS), list[Any]()

        async def one(path: str, query: str) -> int:
            answers: list[Any] = []

            async def send(message: Any) -> None:
                answers.append(message)

            headers = [(b"host", b"localhost")]
            scope = {"type": "http", "method": "GET", "path": path, "headers": headers, "query_string": query.encode()}
            await gate(scope, None, send)  # type: ignore[arg-type]
            sent.append(answers[-1]["body"])
            return int(answers[0]["status"])

        tasks = [asyncio.create_task(one(*each)) for each in wanted]
        await asyncio.sleep(0.01)
        let_go.set()
        statuses = await asyncio.gather(*tasks)
        assert sent.count(BUSY.encode()) == statuses.count(503)
        assert [await one(*each) for each in wanted] == len(wanted) * [200], "those that have ended do not count"
        return statuses

    same, others = (STREAM, "session_hash=a"), [(PROGRESS, f"upload_id={name}") for name in "bcd"]
    assert asyncio.run(asked([same, same, same, (STREAM, "session_hash=a&")])) == [200, 200, 503, 503]
    assert asyncio.run(asked([same, same, *others])) == [200, 200, 200, 200, 503]
