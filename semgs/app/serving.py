"""The server of the app: the page, the rooms, and who may see them. It is built on FastAPI, which gradio brings; nothing else imports it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from html import escape
from math import inf
from pathlib import Path
from typing import Any
from urllib.parse import quote

from semgs.app.door import Door
from semgs.app.jobs import Jobs
from semgs.app.page import check_page_library, mount_page
from semgs.viewer.access import Access
from semgs.viewer.failures import quieten_libraries

HEADER_SECONDS = 15.0
"""The line and the headers of a request have to arrive within this time."""

SENDING_SECONDS, SENDING_BYTES = 60.0, 64 * 1024
"""A browser that takes less of an answer than so much in this time is gone."""

SYSTEM_BYTES = 128 * 1024
"""What the system may hold of an answer. It says that a browser takes it only when a third of that has gone."""

MOST_CONNECTIONS = 400

SOCKETS, OTHER_DESCRIPTORS, BACKLOG = 600, 300, 128
"""Connections that are kept, with those that have sent no request yet; what else the server needs descriptors for; connections that the system keeps waiting."""

HEADERS = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "private, no-store"}


def application(jobs: Jobs, *, local: bool = True, access: Access | None = None) -> Any:
    """The app as an ASGI application.

    Args:
        jobs: the queue.
        local: whether photos stay on this computer, as the page says.
        access: who may use it; by default this machine's browsers, under its own names.

    Raises:
        ImportError: gradio is not installed.
    """
    check_page_library()
    from fastapi import FastAPI
    from fastapi.responses import FileResponse, HTMLResponse, PlainTextResponse

    app = FastAPI(title="SemGS", docs_url=None, redoc_url=None, openapi_url=None)

    @app.get("/rooms/{identifier}/{name:path}")
    def room_file(identifier: str, name: str):  # type: ignore[no-untyped-def]  # FastAPI would read the type as a model
        job = jobs.find(identifier)
        if job is None or job.state != "done":
            return PlainTextResponse("This room is no longer here.", 404)
        path = served_path(job.room, name)
        if path is None:
            return PlainTextResponse("There is no such file.", 404)
        if path.is_dir():
            return HTMLResponse(folder_page(path), headers=HEADERS)
        return FileResponse(path, headers=HEADERS)

    mounted, inputs = mount_page(app, jobs, local)
    return Door(mounted, access or Access(), jobs.uploads, jobs.limits, inputs)


def allow_descriptors(wanted: int) -> int:
    """Let this process have so many descriptors, if the system does. Returns how many it has."""
    if sys.platform == "win32":
        return wanted
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    most = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
    if soft != resource.RLIM_INFINITY and soft < most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
        soft = most
    return wanted if soft == resource.RLIM_INFINITY else soft


def served_path(room: Path, name: str) -> Path | None:
    """A file of a room, or a folder in it whose name ends with a slash; None if there is none, or it is hidden."""
    root = room.resolve()
    try:
        path = (root / name).resolve()
        there = path.is_dir() and path != root if name.endswith("/") else path.is_file()
    except (OSError, ValueError):  # too long for the file system, or with a zero byte
        return None
    if not path.is_relative_to(root) or any(part.startswith(".") for part in path.relative_to(root).parts):
        return None
    return path if there else None


def folder_page(folder: Path) -> str:
    """A page with links to the files of a folder, to which the report links."""
    names = sorted(path.name for path in folder.iterdir() if path.is_file() and not path.name.startswith("."))
    links = "".join(f'<li><a href="{quote(name)}">{escape(name)}</a></li>' for name in names)
    title = escape(folder.name)
    head = '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    return f'{head}<title>{title}</title><body style="font: 16px/1.6 system-ui, sans-serif"><h1>{title}</h1><ul>{links}</ul></body></html>'


def serve(app: Any, host: str, port: int, started: Callable[[int], None]) -> None:
    """Serve until an interrupt.

    Args:
        app: an ASGI application.
        host: address to listen on.
        port: to listen on; 0 is any.
        started: called with the port once it listens.

    Raises:
        OSError: it is not possible to listen there.
    """
    import socket
    import struct

    from uvicorn import Config, Server
    from uvicorn.protocols.http.h11_impl import H11Protocol

    class Protocol(H11Protocol):
        """HTTP whose requests have to arrive, and whose answers have to be taken, in time: else some hundred connections that do neither would keep everybody out."""

        deadline: Any = None
        stuck: Any = None

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            if len(self.connections) > most:  # before there is a request: each takes a descriptor of the system
                self.transport.abort()
            transport.set_write_buffer_limits(high=0)  # pause_writing comes with the first byte that has to wait
            self._option(socket.SO_SNDBUF, SYSTEM_BYTES)
            self._watch()

        def data_received(self, data: bytes) -> None:
            super().data_received(data)
            self._watch()

        def connection_lost(self, exc: Exception | None) -> None:
            self._unwatch()
            self._moves()
            super().connection_lost(exc)

        def pause_writing(self) -> None:
            super().pause_writing()
            self._expect()

        def resume_writing(self) -> None:
            super().resume_writing()
            self._moves()

        def _expect(self, before: float = inf) -> None:
            """Close the connection if by now too little has gone since there were so many bytes [B] to send; else look again later."""
            waiting = self.transport.get_write_buffer_size()
            if waiting <= before - SENDING_BYTES:
                self.stuck = self.loop.call_later(SENDING_SECONDS, self._expect, waiting)
            else:  # at once: the system would keep what it has for the browser
                self._option(socket.SO_LINGER, struct.pack("ii", 1, 0))
                self.transport.abort()

        def _option(self, name: int, value: int | bytes) -> None:
            """Set an option of the connection's socket."""
            connection = self.transport.get_extra_info("socket")
            if connection is not None:
                connection.setsockopt(socket.SOL_SOCKET, name, value)

        def _moves(self) -> None:
            """The answer is being taken."""
            if self.stuck is not None:
                self.stuck.cancel()
                self.stuck = None

        def on_response_complete(self) -> None:
            super().on_response_complete()
            self._watch()

        def _watch(self) -> None:
            """Close the connection later, unless a request has arrived by then. One that is being answered may take its time."""
            if self.cycle is not None and not self.cycle.response_complete:
                self._unwatch()
            elif self.deadline is None:
                self.deadline = self.loop.call_later(HEADER_SECONDS, self.transport.close)

        def _unwatch(self) -> None:
            if self.deadline is not None:
                self.deadline.cancel()
                self.deadline = None

    quieten_libraries()
    most = min(SOCKETS, allow_descriptors(SOCKETS + OTHER_DESCRIPTORS) - OTHER_DESCRIPTORS)
    listening = socket.create_server(
        (host, port),
        backlog=BACKLOG,
        family=socket.AF_INET6 if ":" in host else socket.AF_INET,
        dualstack_ipv6=host == "::" and socket.has_dualstack_ipv6(),
    )
    started(listening.getsockname()[1])
    server = Server(
        Config(
            app, http=Protocol, ws="none", limit_concurrency=MOST_CONNECTIONS, backlog=BACKLOG, log_level="critical", access_log=False,
            timeout_graceful_shutdown=2, server_header=False,
        )
    )  # fmt: skip
    server.run(sockets=[listening])
