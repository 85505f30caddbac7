"""The server that viewers and pages are built on: viser (extra `viewer`). Nothing else imports it."""

from __future__ import annotations

import asyncio
import io
import re
import socket
import threading
from collections.abc import Awaitable, Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager, redirect_stdout
from functools import wraps
from math import inf
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from semgs.files.errors import InputError, needs_extra
from semgs.viewer.access import HOST_NAME, PAGE_POLICY, Access, Refusal
from semgs.viewer.failures import quieten_libraries, tell_failure
from semgs.viewer.viewer_messages import MOST_BYTES, is_plain, take_known_messages

if TYPE_CHECKING:
    from viser import (  # noqa: F401 - the types of viser, for the modules that use this server
        CameraFrustumHandle,
        CameraHandle,
        ClientHandle,
        GaussianSplatHandle,
        GuiCheckboxHandle,
        GuiEvent,
        LabelHandle,
        LineSegmentsHandle,
        SceneClickEvent,
        SceneNodePointerEvent,
        ViserServer,
    )

LOOPBACK = "127.0.0.1"
"""The address that only this machine can reach."""

EVERY_ADDRESS, EVERY_ADDRESS_6 = "0.0.0.0", "::"

ANY_PORT = 0

_starting = threading.Lock()

MOST_BROWSERS, SENDING_SECONDS, SENDING_BYTES = 64, 60.0, 64 * 1024
"""Browsers that are connected at once; one that takes less of what is sent than so much in this time is gone."""

WRONG_VERSION = "This page is of another version. Load it again."

ELSEWHERE = ("websocket=", "playbackPath=")
"""What makes viser's page take its content, scripts included, from another server."""


def check_viewer_library() -> None:
    """Check that scenes can be viewed.

    Raises:
        ImportError: viser is not installed.
    """
    with needs_extra("viewer", "viewing needs viser", "viser"):
        import viser  # noqa: F401


@contextmanager
def serving(host: str = LOOPBACK, port: int = ANY_PORT, access: Access | None = None) -> Iterator[ViserServer]:
    """A server without content, which stops at the end of the block.

    Args:
        host: address to listen on.
        port: to listen on, or the next free one; 0 is any.
        access: who may talk to it; by default this machine's browsers, under its own names.

    Raises:
        ImportError: viser is not installed.
        InputError: it is not possible to listen on this address.
    """
    check_viewer_library()
    from viser import ViserServer, _gui_api, _scene_api, _viser

    try:
        with socket.socket() as trial:
            trial.bind((host, ANY_PORT))  # viser would try for ever
    except OSError as error:
        raise InputError(host, "an IPv4 address of this machine", str(error.strerror or error)) from error
    # viser prints addresses, and that it stopped
    with redirect_stdout(io.StringIO()), _guarded_websockets(access or Access()):
        server = ViserServer(host=host, port=port, verbose=False)
    try:
        # A page from elsewhere that connects to this server could ask for a public address, also without the button.
        server.request_share_url = _refuse  # type: ignore[method-assign]
        take_known_messages(server)
        quieten_libraries()
        for module in (_viser, _gui_api, _scene_api):
            vars(module)["print_threadpool_errors"] = _tell_failure_of
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        yield server
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()


def _tell_failure_of(work: Future[Any]) -> None:
    """Tell of work in a thread that failed."""
    error = work.exception()
    if error is not None:
        tell_failure(error)


@contextmanager
def _guarded_websockets(access: Access) -> Iterator[None]:
    """Servers of the library `websockets` that start inside this block answer only requests that `access` lets in. viser itself has no such check."""
    from websockets.asyncio import server as library

    serve, browsers = library.serve, 0

    @wraps(serve)
    def guarded(
        handler: Callable[..., Any], *args: Any, process_request: Callable[..., Any] | None = None, **options: Any
    ) -> Any:
        async def answered(connection: Any) -> None:
            nonlocal browsers
            if browsers >= MOST_BROWSERS:
                connection.transport.abort()
                return
            connection.recv = _only_plain(connection.recv)
            _take_no_parts(connection.protocol)
            watch = asyncio.create_task(_end_if_stuck(connection.transport))
            browsers += 1
            try:
                await handler(connection)
            finally:
                browsers -= 1
                watch.cancel()

        options["max_size"] = MOST_BYTES
        return serve(answered, *args, process_request=_guarded(access, process_request), **options)

    with _starting:
        library.serve = guarded  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            library.serve = serve  # type: ignore[misc]


async def _end_if_stuck(transport: asyncio.WriteTransport) -> None:
    """End a connection whose browser takes less than `SENDING_BYTES` in `SENDING_SECONDS`: it would hold the whole scene."""
    before = inf
    while True:
        await asyncio.sleep(SENDING_SECONDS)
        waiting = transport.get_write_buffer_size()
        if waiting > max(before - SENDING_BYTES, SENDING_BYTES):
            transport.abort()
            return
        before = waiting if waiting > SENDING_BYTES else inf


def _only_plain(receive: Callable[[], Awaitable[Any]]) -> Callable[[], Awaitable[Any]]:
    """Receives messages that a page of ours sends; others are left out."""

    async def received() -> Any:
        while not is_plain(raw := await receive()):
            pass
        return raw

    return received


def _take_no_parts(protocol: Any) -> None:
    """Let a connection end where a message comes in parts, as none of our page does: the library keeps the parts, and counts neither them nor those without content."""
    from websockets.exceptions import ProtocolError
    from websockets.frames import DATA_OPCODES, OP_CONT

    receive = protocol.recv_frame

    def received(frame: Any) -> None:
        if frame.opcode in DATA_OPCODES and (frame.opcode == OP_CONT or not frame.fin):
            raise ProtocolError("a message in parts")
        receive(frame)

    protocol.recv_frame = received


def _guarded(access: Access, answer: Callable[..., Any] | None) -> Callable[..., Any]:
    """What answers HTTP requests, WebSocket handshakes included, if `access` lets them in."""
    import viser
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    def process(connection: Any, request: Any) -> Any:
        headers = list(request.headers.raw_items())
        websocket = any(name.lower() == "upgrade" for name, _ in headers)
        query = request.path.partition("?")[2]
        refusal = access.refusal("GET", headers, query, websocket)
        spoken = [value.strip() for name, value in headers if name.lower() == "sec-websocket-protocol"]
        if refusal is None and websocket and spoken != [f"viser-v{viser.__version__}"]:  # viser would print it
            refusal = Refusal(400, WRONG_VERSION)
        if refusal is None and not websocket and any(name in unquote(query) for name in ELSEWHERE):
            refusal = Refusal(303, "", (("location", "./"),))
        if refusal is None:
            try:
                response = answer(connection, request) if answer else None
            except (OSError, ValueError):  # a path that no file can have
                return Response(404, "Not Found", Headers())
            if response is not None:
                own = " ".join(f"{scheme}://{place}" for place in _places(headers, access) for scheme in ("ws", "wss"))
                response.headers["Content-Security-Policy"] = (
                    f"{PAGE_POLICY}; connect-src 'self' data: blob: {own}; {access.frame_ancestors}"
                )
                response.headers["X-Content-Type-Options"] = "nosniff"
                response.headers["Referrer-Policy"] = "same-origin"
            return response
        body = refusal.sentence.encode()
        told = {
            "Content-Type": "text/plain; charset=utf-8",
            "Content-Length": str(len(body)),
            "Referrer-Policy": "no-referrer",
        }
        return Response(refusal.status, "Refused", Headers({**told, **dict(refusal.headers)}), body)

    return process


def _places(headers: Sequence[tuple[str, str]], access: Access) -> list[str]:
    """Hosts, with ports, that a page of the server may open WebSockets to: its own."""
    host = next((value.strip().lower() for name, value in headers if name.lower() == "host"), "")
    name = re.sub(r":\d{1,5}$", "", host)
    return [*([host] if HOST_NAME.fullmatch(name) else []), *(f"{one}:*" for one in access.names)]


def run_script(target: ViserServer | ClientHandle, source: str, key: str | None = None) -> None:
    """Run a script in a browser, or in every one, also in those that connect later.

    Args:
        target: a browser, or the server for every one.
        source: of the script.
        key: of several scripts with one key, browsers that connect later run the last alone.
    """
    from viser._messages import RunJavascriptMessage

    message = RunJavascriptMessage(source)
    if key is not None:
        vars(message)["redundancy_key"] = lambda: f"semgs:{key}"
    target.gui._websock_interface.queue_message(message)


def url_of(server: ViserServer) -> str:
    """What to open in a browser."""
    return url_of_address(server.get_host(), server.get_port())


def url_of_address(host: str, port: int) -> str:
    """What to open in a browser: the name of this machine if it listens on every address, and IPv6 in brackets."""
    if host in (EVERY_ADDRESS, EVERY_ADDRESS_6):
        host = socket.gethostname()
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


def is_this_machine(host: str) -> bool:
    """Whether only this machine can reach an address."""
    return host in (LOOPBACK, "localhost", "::1")


def _refuse(verbose: bool = True) -> None:
    """Scenes are not shared through viser's tunnel."""
