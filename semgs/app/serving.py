"""The server of the app: the page, the rooms, and who may see them. It is built on FastAPI, which gradio brings; nothing else imports it."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from html import escape
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, quote

from semgs.app.jobs import Jobs
from semgs.app.page import check_page_library, mount_page

COOKIE = "semgs_token"
LOCAL_HOSTS = ("127.0.0.1", "localhost", "[::1]")

HEADERS = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "private, no-store"}


def application(jobs: Jobs, *, local: bool = True, token: str | None = None) -> Any:
    """The app as an ASGI application.

    Args:
        jobs: the queue.
        local: whether only this machine can reach it: then other host names are refused, so that no page from elsewhere can read it through DNS.
        token: what a browser has to show once, as ?token=...; None for nothing.

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

    mounted = mount_page(app, jobs, local)
    return Door(mounted, token, LOCAL_HOSTS if local else None)


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


class Door:
    """Lets in who may come in: with the token, or from this machine.

    Args:
        app: the ASGI application behind it.
        token: what a browser has to show once; None for nothing.
        hosts: names under which the app may be opened; None for any.
    """

    def __init__(self, app: Callable[..., Any], token: str | None, hosts: tuple[str, ...] | None) -> None:
        self._app, self._token, self._hosts = app, token, hosts

    async def __call__(self, scope: dict[str, Any], receive: Callable[..., Any], send: Callable[..., Any]) -> None:
        """Answer one request."""
        if scope["type"] not in ("http", "websocket"):
            return await self._app(scope, receive, send)
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        if self._hosts is not None and headers.get("host", "").rsplit(":", 1)[0] not in self._hosts:
            return await _refuse(scope, send, 421, "Open this page as http://127.0.0.1.")
        if self._token is None:
            return await self._app(scope, receive, send)
        if _matches(_cookie(headers.get("cookie", "")), self._token):
            return await self._app(scope, receive, send)
        query = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        if scope["type"] == "http" and _matches(query.get("token", [""])[0], self._token):
            rest = "&".join(
                f"{name}={values[0]}" for name, values in query.items() if name == "room" and values[0].isalnum()
            )
            cookie = f"{COOKIE}={self._token}; HttpOnly; SameSite=Strict; Path=/"
            return await _refuse(
                scope, send, 303, "", {"location": "/" + (f"?{rest}" if rest else ""), "set-cookie": cookie}
            )
        return await _refuse(
            scope, send, 403, "This page needs the address with its token, which semgs app printed when it started."
        )


def _cookie(text: str) -> str:
    """The token in a header of cookies; empty without one."""
    try:
        found = SimpleCookie(text).get(COOKIE)
    except CookieError:
        return ""
    return found.value if found else ""


def _matches(given: str, token: str) -> bool:
    """Whether a token is the right one."""
    return secrets.compare_digest(given.encode(), token.encode())


async def _refuse(
    scope: dict[str, Any], send: Callable[..., Any], status: int, text: str, more: dict[str, str] | None = None
) -> None:
    """Answer with a status and a sentence."""
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008})
        return
    headers = {"content-type": "text/plain; charset=utf-8", "referrer-policy": "no-referrer", **(more or {})}
    listed = [(name.encode(), value.encode("latin-1")) for name, value in headers.items()]
    await send({"type": "http.response.start", "status": status, "headers": listed})
    await send({"type": "http.response.body", "body": text.encode()})


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

    from uvicorn import Config, Server

    listening = socket.create_server(
        (host, port),
        family=socket.AF_INET6 if ":" in host else socket.AF_INET,
        dualstack_ipv6=host == "::" and socket.has_dualstack_ipv6(),
    )
    started(listening.getsockname()[1])
    server = Server(
        Config(app, log_level="warning", access_log=False, timeout_graceful_shutdown=2, server_header=False)
    )
    server.run(sockets=[listening])
