"""Who may talk to a server that SemGS starts: by the Host, Origin and Sec-Fetch headers of a request, and a token.

A browser sends requests to 127.0.0.1 for any page that asks it to. So every server checks three things:

- **Host** is a name of this server. A page elsewhere can point its own name at 127.0.0.1 (DNS rebinding), but cannot change this header.
- **Origin** is this server, down to the port. WebSockets and form uploads reach other origins without asking.
- **Token**: if other machines can reach the server, a browser shows it once, and has it as a cookie from then on.
"""

from __future__ import annotations

import hashlib
import ipaddress
import re
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

LOCAL_HOSTS = ("127.0.0.1", "localhost", "[::1]")

PAGE_POLICY = (
    "default-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; object-src 'none'; base-uri 'self'; form-action 'self'; "
    "script-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:"
)
"""What a page may load: only from its own server. gradio and viser start scripts that are written into the page, viser also those that its server sends."""

SAFE_METHODS = ("GET", "HEAD")

WRONG_HOST = (
    "Open this page as http://127.0.0.1. For a proxy or another name, start the program with --allow-host NAME."
)
WRONG_ORIGIN = "Another page sent this request, so it was refused."
NO_TOKEN = "This page needs the address with its token, which was printed when the program started."

HOST_NAME = re.compile(r"[a-z0-9._-]+|\[[0-9a-f:.]+\]")


def host_name(text: str) -> str:
    """A host name as --allow-host takes it, in lower case.

    Raises:
        ValueError: it is not only a name or an address: no scheme, port or path; or it is a name that every program of this machine has.
    """
    name = text.lower()
    if not HOST_NAME.fullmatch(name):
        raise ValueError(
            f"{text!r} is not a host name; expected one like room.example or 192.168.1.5, without http:// and port"
        )
    if _is_local(name):
        raise ValueError(
            f"{text!r} needs no permission, and with it pages of all programs of this machine could use the server"
        )
    return name


@dataclass(frozen=True)
class Refusal:
    """The answer to a request that is not let in.

    Attributes:
        status: HTTP status.
        sentence: the body.
        headers: more headers.
    """

    status: int
    sentence: str
    headers: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Access:
    """Who may talk to a server.

    Attributes:
        hosts: names that the Host header may have, besides `names`; None for any. Give None only with a token, or if everything is public.
        token: what a browser has to show once, as ?token=...; None for nothing.
        names: further names of this server, such as that of a proxy. An Origin may have them, too, with any scheme and port.
        frames: sources of pages that may show this server in a frame, besides its own ("https://hub.example").
    """

    hosts: tuple[str, ...] | None = LOCAL_HOSTS
    token: str | None = None
    names: tuple[str, ...] = ()
    frames: tuple[str, ...] = ()

    @property
    def frame_ancestors(self) -> str:
        """The directive of a Content-Security-Policy that says who may frame the server's pages."""
        named = [f"{scheme}://{name}:*" for name in self.names for scheme in ("http", "https")]
        return " ".join(["frame-ancestors 'self'", *named, *self.frames])

    def knows(self, host: str) -> bool:
        """Whether the server may be opened under a name, with a port or without."""
        name = _name(host.lower())
        return bool(name) and (self.hosts is None or name in (*self.hosts, *self.names))

    def is_foreign(self, headers: Iterable[tuple[str, str]]) -> bool:
        """Whether a browser says that a page elsewhere sent a request, as a link or a frame does."""
        return _is_foreign_site([value.strip() for name, value in headers if name.lower() == "sec-fetch-site"])

    def refusal(
        self, method: str, headers: Iterable[tuple[str, str]], query: str = "", websocket: bool = False
    ) -> Refusal | None:
        """Why a request is not let in; None if it is.

        Args:
            method: of the request.
            headers: names and values, as sent.
            query: the part of the address after "?".
            websocket: whether it opens a WebSocket.
        """
        given: dict[str, list[str]] = {}
        for name, value in headers:
            given.setdefault(name.lower(), []).append(value.strip())
        hosts, origins = given.get("host", []), given.get("origin", [])
        if len(hosts) != 1 or len(origins) > 1:
            return Refusal(421 if not hosts else 400, WRONG_HOST)
        host = hosts[0].lower()
        if not self.knows(host):
            return Refusal(421, WRONG_HOST)
        if origins and not self._is_own(origins[0].lower(), host):
            return Refusal(403, WRONG_ORIGIN)
        if self._is_foreign_fetch(method, given, websocket):
            return Refusal(403, WRONG_ORIGIN)
        return self._token_refusal(method, given, query, websocket)

    def _is_own(self, origin: str, host: str) -> bool:
        """Whether an origin is this server."""
        scheme, separator, place = origin.partition("://")
        if scheme not in ("http", "https") or not separator:  # "null": a sandboxed frame or a file
            return False
        return place == host or _name(place) in self.names

    def _is_foreign_fetch(self, method: str, given: dict[str, list[str]], websocket: bool) -> bool:
        """Whether a browser says that a page elsewhere sent the request. Links and frames from elsewhere may open pages, and nothing else."""
        if not _is_foreign_site(given.get("sec-fetch-site", [])):
            return False
        opens_a_page = given.get("sec-fetch-mode") == ["navigate"] and method in SAFE_METHODS and not websocket
        return not opens_a_page

    def _token_refusal(self, method: str, given: dict[str, list[str]], query: str, websocket: bool) -> Refusal | None:
        """Why a request is not let in by its token; the first request with it gets a cookie."""
        if self.token is None:
            return None
        name = cookie_name(self.token)
        if any(_matches(value, self.token) for text in given.get("cookie", []) for value in _cookies(text, name)):
            return None
        values = parse_qs(query, max_num_fields=20) if query.count("&") < 20 else {}
        if websocket or method not in SAFE_METHODS or not _matches(values.get("token", [""])[0], self.token):
            return Refusal(403, NO_TOKEN)
        room = values.get("room", [""])[0]
        location = f"?room={room}" if room.isascii() and room.isalnum() else "./"
        # With SameSite=Strict, a browser that came from a page elsewhere, such as a chat with the address in it, would not send it.
        cookie = f"{name}={self.token}; HttpOnly; SameSite=Lax; Path=/"
        return Refusal(303, "", (("location", location), ("set-cookie", cookie)))


def new_token() -> str:
    """An unguessable token."""
    return secrets.token_urlsafe(18)


def cookie_name(token: str) -> str:
    """The name of the cookie with a token. Browsers send cookies to all ports of a host, so servers on one host need different names."""
    return f"semgs_{hashlib.sha256(token.encode()).hexdigest()[:8]}"


def access_to(local: bool, names: Sequence[str] = ()) -> Access:
    """Access to a server that only this machine can reach, or that others can reach, too, who then need a token.

    Args:
        local: whether only this machine can reach it.
        names: further names of it, such as that of a proxy.
    """
    return Access(LOCAL_HOSTS, None, tuple(names)) if local else Access(None, new_token(), tuple(names))


def _name(place: str) -> str:
    """The name in "name:port", IPv6 addresses in brackets; empty if it is neither."""
    try:
        split = urlsplit(f"//{place}")
        name, port = split.hostname or "", split.port
    except ValueError:
        return ""
    written = f"[{name}]" if ":" in name else name
    return written if place in (written, f"{written}:{port}") else ""


def _is_local(name: str) -> bool:
    """Whether a host name means the machine that it is looked up on, whoever else it is."""
    bare = name.rstrip(".").strip("[]")
    if bare == "localhost" or bare.endswith(".localhost"):
        return True
    try:
        address = ipaddress.ip_address(bare)
    except ValueError:
        return False
    mapped = getattr(address, "ipv4_mapped", None) or address
    return mapped.is_loopback or mapped.is_unspecified


def _is_foreign_site(sites: Sequence[str]) -> bool:
    """Whether a header Sec-Fetch-Site, as sent, names another site than this server or none."""
    return any(site not in ("same-origin", "none") for site in sites)


def _cookies(text: str, name: str) -> list[str]:
    """The values of the cookies of a name in a header, whatever others are in it: programs on other ports of the host have theirs there, too."""
    pairs = (one.strip().partition("=") for one in text.split(";"))
    return [value for own, _, value in pairs if own == name]


def _matches(given: str, token: str) -> bool:
    """Whether a token is the right one."""
    return secrets.compare_digest(given.encode(errors="surrogatepass"), token.encode())
