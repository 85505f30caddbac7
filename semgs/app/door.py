"""What stands in front of gradio: only what the page uses gets through, only from those who may use it, and no more than fits.

gradio serves some sixty routes, for programs, developers and other sites. The page needs the few in `ROUTES`; the others do not exist here.
"""

from __future__ import annotations

import asyncio
import json
import re
import stat
import time
from collections import Counter
from collections.abc import Awaitable, Callable, MutableMapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeGuard
from urllib.parse import parse_qsl

from semgs.app.limits import MIB, Limits
from semgs.app.uploads import GONE, UnusableUploadError, content_of, delete_oldest
from semgs.files.strict_json import parse_json
from semgs.viewer.access import PAGE_POLICY, WRONG_ORIGIN, Access
from semgs.viewer.failures import tell_failure

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]

JOIN, STREAM, UPLOAD = "/gradio_api/queue/join", "/gradio_api/queue/data", "/gradio_api/upload"
PROGRESS = "/gradio_api/upload_progress"

NAME = r"[A-Za-z0-9_.+-]+"

PAGES = ("/rooms/",)
"""Where links from elsewhere may lead, beside the page itself."""

ROUTES = (
    ("GET HEAD", r"/"),
    ("GET HEAD", rf"/(assets|static)(/{NAME})+"),
    ("GET HEAD", r"/theme\.css"),
    ("GET HEAD", r"/favicon\.ico"),
    ("GET HEAD", r"/rooms/[a-z0-9]{20}/.+"),
    ("GET", re.escape(STREAM)),
    ("GET", re.escape(PROGRESS)),
    ("POST", re.escape(JOIN)),
    ("POST", re.escape(UPLOAD)),
)
"""Methods and paths that the page uses."""

MOST_JSON = 256 * 1024
"""Largest body of a request other than an upload [bytes]."""

MOST_FILES, MOST_LETTERS = 100, 1000
"""Files of a call, unless the limits say it, and letters of a text in it: gradio keeps what the last thousands of pages sent."""

MEASURED_BYTES = 4 * MIB
"""After so much of an upload, it is checked whether the folder is full."""

MOST_STREAMS, STREAMS_OF_ONE = 300, 2
"""So many answers that last as long as what they tell of are open at once, and so many of one page or upload: the server keeps connections for other answers."""

BODY_SECONDS, BODY_BYTES = 30.0, 4096
"""In so long, a browser sends all that is left of a body, or so many bytes a second on average, again and again: a fast start earns no slow end."""

DOWNLOAD_SECONDS = 3600.0
"""A file of a room is sent within this time. Until then it takes its place on the disk, though the room may be deleted."""

PREFIX = re.compile(r"(/[A-Za-z0-9_.~@-]+)*")
"""Where a proxy may put the page."""

ROOM = re.compile(r"(?:^|&)(room=[a-z0-9]{1,40})(?:&|$)")
"""Of the page's address, what a function may need to know."""

SESSION = re.compile(r"[a-z0-9]{1,40}")

QUERIES = {
    STREAM: ("session_hash",),
    PROGRESS: ("upload_id",),
    UPLOAD: ("upload_id",),
}
"""What the addresses of gradio's routes may have after "?", each a short word once: gradio keeps it."""

MULTIPART = re.compile(r"multipart/form-data; ?boundary=[A-Za-z0-9'()+_,./:=?-]{1,70}", re.IGNORECASE)
"""The type of an upload as browsers send it; other parameters, such as a character set, are for programs."""

BAD_REQUEST = "This is not a request of the page."
BUSY = "Too many pages are open on this server. Try again in some minutes."
FULL = "Too many files wait on this server. Try again in some minutes."


class Door:
    """Lets through what the page needs, from those who may use it.

    Args:
        app: the ASGI application behind it.
        access: who may use it.
        uploads: the folder for what browsers send.
        limits: of uploads.
        inputs: how many values each function of the page takes, in gradio's order.
    """

    def __init__(
        self, app: Callable[..., Any], access: Access, uploads: Path, limits: Limits, inputs: Sequence[int] = ()
    ) -> None:
        self._app, self._access, self._limits, self._inputs = app, access, limits, inputs
        self._uploads = uploads
        self._streams = Counter[str]()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] not in ("http", "websocket"):
            return await self._app(scope, receive, send)
        headers = [(name.decode("latin-1"), value.decode("latin-1")) for name, value in scope["headers"]]
        method, path = scope.get("method", "GET"), scope["path"]
        websocket = scope["type"] == "websocket"
        query = scope.get("query_string", b"").decode("latin-1")
        refusal = self._access.refusal(method, headers, query, websocket)
        if refusal is not None:
            return await _answer(scope, send, refusal.status, refusal.sentence, refusal.headers)
        if websocket or not is_known(method, path) or not is_plain(path, query):
            return await _answer(scope, send, 404, "There is no such page.")
        if path != "/" and not path.startswith(PAGES) and self._access.is_foreign(headers):
            return await _answer(scope, send, 403, WRONG_ORIGIN)
        scope = self._named(scope, headers)
        if path in ("/", JOIN):
            scope["query_string"] = room_of(query)
        send = self._with_policy(send, path)
        if path == JOIN:
            return await self._join(scope, receive, send)
        if path == UPLOAD:
            return await self._upload(scope, receive, send, headers)
        if path in (STREAM, PROGRESS):
            return await self._stream(f"{path} {parse_qsl(query)}", scope, receive, send)
        if path.startswith(PAGES):
            with suppress(TimeoutError):  # the server closes a connection whose answer is not complete
                async with asyncio.timeout(DOWNLOAD_SECONDS):
                    await self._pass(scope, receive, send)
            return None
        return await self._pass(scope, receive, send)

    async def _pass(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let a request through. What fails behind the door is one line in the terminal."""
        started = False

        async def noted(message: Message) -> None:
            nonlocal started
            started = True
            await send(message)

        try:
            await self._app(scope, receive, noted)
        except _StopReadingError as error:
            if not started:
                await _answer(scope, send, error.status, error.sentence)
        except Exception as error:
            tell_failure(error)
            if not started:
                await _answer(scope, send, 500, "This request could not be answered.")

    async def _stream(self, name: str, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through a request whose answer lasts, unless there are too many."""
        if self._streams[name] >= STREAMS_OF_ONE or self._streams.total() >= MOST_STREAMS:
            return await _answer(scope, send, 503, BUSY)
        self._streams[name] += 1
        try:
            await self._pass(scope, receive, send)
        finally:
            self._streams[name] -= 1
            self._streams += Counter()  # without those of which none is open

    async def _join(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through a call of one of the page's functions, rewritten so that it holds nothing but what such a call needs."""
        try:
            body = await _whole(receive, MOST_JSON)
            checked = checked_call(parse_json(body), self._inputs, self._uploads, self._limits.photos + 1)
        except _StopReadingError as error:
            return await _answer(scope, send, error.status, error.sentence)
        except UnusableUploadError as error:
            return await _answer(scope, send, 400, str(error))
        except ValueError:
            return await _answer(scope, send, 400, BAD_REQUEST)
        data = json.dumps(checked).encode()
        kept = [(name, value) for name, value in scope["headers"] if name not in (b"content-length", b"content-type")]
        told = [(b"content-type", b"application/json"), (b"content-length", str(len(data)).encode())]
        await self._pass({**scope, "headers": kept + told}, _replayed(data, receive), send)

    async def _upload(self, scope: Scope, receive: Receive, send: Send, headers: Sequence[tuple[str, str]]) -> None:
        """Let through an upload that fits beside the others."""
        if not MULTIPART.fullmatch(_only(headers, "content-type")):
            return await _answer(scope, send, 400, BAD_REQUEST)
        most = self._limits.total_bytes
        length = _only(headers, "content-length")
        announced = int(length) if length.isdecimal() and len(length) < 16 else None
        if announced is not None and announced > most:
            return await _answer(scope, send, 413, "These files are too large.")
        room = (self._limits.uploads - 1, self._limits.uploads_bytes - (announced or 0))
        if not await asyncio.to_thread(delete_oldest, self._uploads, *room):
            return await _answer(scope, send, 507, FULL)
        left, complete = most if announced is None else announced, False
        measured, body = left, _Body(receive)

        # What others have announced keeps no place: it may never come. So the folder is measured again as this one arrives.
        async def counted() -> Message:
            nonlocal left, complete, measured
            message = await receive() if complete else await body.next()
            left -= len(message.get("body", b""))
            complete = not message.get("more_body", False)
            if left < 0:
                raise _StopReadingError(413, "These files are too large.")
            if measured - left >= MEASURED_BYTES:
                measured = left
                if (await asyncio.to_thread(content_of, self._uploads))[1] > self._limits.uploads_bytes:
                    raise _StopReadingError(507, FULL)
            return message

        await self._pass(scope, counted, _without_folder(send, self._uploads))

    def _named(self, scope: Scope, headers: Sequence[tuple[str, str]]) -> Scope:
        """A request that tells gradio no other name of this server than those it has. gradio writes them into its page, and calls them from there.

        A proxy may serve the page below a path of its own, and says so. It takes that path away itself: Starlette would take it away once more, and so make another
        path of one that is known.
        """
        forwarded, prefix = _only(headers, "x-forwarded-host"), _only(headers, "x-forwarded-prefix").rstrip("/")
        left_out = {b"x-gradio-server", *(() if self._access.knows(forwarded) else (b"x-forwarded-host",))}
        kept = [(name, value) for name, value in scope["headers"] if name not in left_out]
        usable = PREFIX.fullmatch(prefix) and not f"{scope['path']}/".startswith(f"{prefix}/")
        return {**scope, "headers": kept, "root_path": prefix if usable else ""}

    def _with_policy(self, send: Send, path: str) -> Send:
        """Adds the headers that say what a page may load, and who may frame it."""
        policy = f"{PAGE_POLICY}; {self._access.frame_ancestors}"
        more = {
            b"content-security-policy": policy.encode("latin-1"),
            b"x-content-type-options": b"nosniff",
            b"referrer-policy": b"same-origin",
        }

        async def sent(message: Message) -> None:
            if message["type"] == "http.response.start":
                listed = [(name, value) for name, value in message.get("headers", ()) if name.lower() not in more]
                message = {**message, "headers": [*listed, *more.items()]}
            await send(message)

        return sent


def is_known(method: str, path: str) -> bool:
    """Whether the page uses a route."""
    if ".." in path.split("/") or "\\" in path or "\0" in path:
        return False
    return any(method in methods.split() and re.fullmatch(route, path) for methods, route in ROUTES)


def is_plain(path: str, query: str) -> bool:
    """Whether what follows "?" is only what the page sends to a route of gradio. Calls have that of the page's address, see `room_of`."""
    if path == JOIN:
        return True
    if path not in QUERIES:
        return not path.startswith("/gradio_api/") or not query
    pairs = parse_qsl(query, keep_blank_values=True) if query.count("&") < 4 else [("", "")]
    names = [name for name, _ in pairs]
    return (
        len(set(names)) == len(names)
        and set(names) <= set(QUERIES[path])
        and all(SESSION.fullmatch(value) for _, value in pairs)
    )


def room_of(query: str) -> bytes:
    """The room in the query of the page's address; gradio has uses of its own for other words, and adds all to each call."""
    room = ROOM.search(query)
    return b"" if room is None else room[1].encode()


def checked_call(body: Any, inputs: Sequence[int], uploads: Path, most: int = MOST_FILES) -> dict[str, Any]:
    """A call of one of the page's functions, with nothing in it but what that needs.

    Args:
        body: what a browser sent, from JSON.
        inputs: how many values each function takes.
        uploads: the folder for what browsers send; files are in it.
        most: files of a call.

    Raises:
        ValueError: it is no such call.
        UnusableUploadError: a file is not in the folder.
    """
    if not isinstance(body, dict):
        raise ValueError(BAD_REQUEST)
    number, session, data, trigger = (body.get(name) for name in ("fn_index", "session_hash", "data", "trigger_id"))
    if not _is_count(number) or number >= len(inputs) or not isinstance(data, list) or len(data) != inputs[number]:
        raise ValueError(BAD_REQUEST)
    if not isinstance(session, str) or not SESSION.fullmatch(session) or not (trigger is None or _is_count(trigger)):
        raise ValueError(BAD_REQUEST)
    return {
        "data": [_checked_value(value, uploads, most) for value in data],
        "event_data": None,
        "fn_index": number,
        "trigger_id": trigger,
        "session_hash": session,
    }


def inside(path: Path, folder: Path) -> bool:
    """Whether a path is a file of its own inside a folder, after resolving links, and not a link, a device or a pipe."""
    try:
        status = path.lstat()
        within = path.resolve(strict=True).is_relative_to(folder.resolve())
    except (OSError, ValueError, RuntimeError):
        return False
    return within and stat.S_ISREG(status.st_mode)


class _StopReadingError(Exception):
    """A body that is not read any further."""

    def __init__(self, status: int, sentence: str) -> None:
        super().__init__(sentence)
        self.status, self.sentence = status, sentence


def _checked_value(value: Any, uploads: Path, most: int) -> Any:
    """A value of an input: a short text, a number, nothing, or a list of different uploaded files."""
    if value is None or isinstance(value, int | float):
        return value
    if isinstance(value, str) and len(value) <= MOST_LETTERS:
        value.encode()  # halves of characters are no text
        return value
    if isinstance(value, list) and len(value) <= most:
        files = [_checked_file(one, uploads) for one in value]
        if len({one["path"] for one in files}) == len(files):
            return files
    raise ValueError(BAD_REQUEST)


def _checked_file(value: Any, uploads: Path) -> dict[str, Any]:
    """An uploaded file. All that gradio needs is its path."""
    if not isinstance(value, dict) or not isinstance(value.get("path"), str):
        raise ValueError(BAD_REQUEST)
    path, name = uploads / value["path"], value.get("orig_name")
    if not inside(path, uploads):
        raise UnusableUploadError(GONE)
    return {
        "path": str(path.resolve()),
        "orig_name": name if isinstance(name, str) and len(name) <= MOST_LETTERS else path.name,
        "meta": {"_type": "gradio.FileData"},
    }


def _without_folder(send: Send, folder: Path) -> Send:
    """Sends an answer that lists paths in a folder, as gradio does after an upload, with the paths from that folder on: users need not know which folder that is."""
    held: list[Message] = []

    async def sent(message: Message) -> None:
        held.append(message)
        if message["type"] == "http.response.start" or message.get("more_body", False):
            return
        body = b"".join(one.get("body", b"") for one in held[1:])
        with suppress(ValueError, TypeError):
            body = json.dumps(
                [str(Path(path).resolve().relative_to(folder.resolve())) for path in json.loads(body)]
            ).encode()
        kept = [(name, value) for name, value in held[0].get("headers", ()) if name.lower() != b"content-length"]
        await send({**held[0], "headers": [*kept, (b"content-length", str(len(body)).encode())]})
        await send({**message, "body": body})

    return sent


def _only(headers: Sequence[tuple[str, str]], name: str) -> str:
    """The value of a header that was sent once; of several, gradio could take another than the one that is checked, so they are as none."""
    values = [value for own, value in headers if own.lower() == name]
    return values[0] if len(values) == 1 else ""


def _is_count(value: Any) -> TypeGuard[int]:
    """Whether a value is a whole number from 0."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1_000_000


class _Body:
    """A body as it arrives, in time."""

    def __init__(self, receive: Receive) -> None:
        self._receive, self._until, self._size = receive, time.monotonic() + BODY_SECONDS, 0

    async def next(self) -> Message:
        """The next part.

        Raises:
            _StopReadingError: too little comes in `BODY_SECONDS`.
        """
        try:
            message = await asyncio.wait_for(self._receive(), max(self._until - time.monotonic(), 0.0))
        except TimeoutError as error:
            raise _StopReadingError(408, "Too little came for too long.") from error
        self._size += len(message.get("body", b""))
        if self._size >= BODY_BYTES * BODY_SECONDS:
            self._until, self._size = time.monotonic() + BODY_SECONDS, 0
        return message


async def _whole(receive: Receive, most: int) -> bytes:
    """The body of a request."""
    parts, size, body = [], 0, _Body(receive)
    while True:
        message = await body.next()
        if message["type"] != "http.request":
            raise _StopReadingError(400, BAD_REQUEST)
        parts.append(message.get("body", b""))
        size += len(parts[-1])
        if size > most:
            raise _StopReadingError(413, BAD_REQUEST)
        if not message.get("more_body", False):
            return b"".join(parts)


def _replayed(data: bytes, receive: Receive) -> Receive:
    """Gives a body that was read already, then what follows it."""
    parts = [{"type": "http.request", "body": data, "more_body": False}]

    async def again() -> Message:
        return parts.pop() if parts else await receive()

    return again


async def _answer(scope: Scope, send: Send, status: int, text: str, more: Sequence[tuple[str, str]] = ()) -> None:
    """Answer with a status and a sentence."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    headers = [("content-type", "text/plain; charset=utf-8"), ("referrer-policy", "no-referrer"), *more]
    listed = [(name.encode(), value.encode("latin-1")) for name, value in headers]
    await send({"type": "http.response.start", "status": status, "headers": listed})
    await send({"type": "http.response.body", "body": text.encode()})
