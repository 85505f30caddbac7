"""Who may talk to the viewer and the app: names of the server, pages elsewhere, the token and the cookie that it becomes."""

from __future__ import annotations

import socket
from urllib.parse import urlsplit

import pytest
from wall_and_chair import wall_and_chair

from semgs.viewer.access import Access, Refusal, access_to, cookie_name, host_name
from semgs.viewer.window import open_window

TOKEN = "a-token"
COOKIE = "semgs_1f6076e3"
LOCAL = Access()
PUBLIC = Access(None, TOKEN)
PROXIED = Access(names=("hub.example",))
SPACE = Access(None, None, ("room.hf.space",), ("https://huggingface.co",))


def status(access: Access, method: str = "GET", query: str = "", websocket: bool = False, **headers: str) -> int:
    """The status of the answer; 200 where the request is let in."""
    listed = [(name.replace("_", "-"), value) for name, value in headers.items()]
    refusal = access.refusal(method, listed, query, websocket)
    return 200 if refusal is None else refusal.status


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1:7860", 200), ("localhost:7860", 200), ("[::1]:7860", 200), ("127.0.0.1", 200), ("[::1]", 200), ("LOCALHOST:1", 200),
        ("evil.example:7860", 421), ("127.0.0.1.evil.example:80", 421), ("evil.example@127.0.0.1:80", 421), ("127.0.0.1:80@evil.example", 421),
        ("localhost.:7860", 421), ("2130706433:7860", 421), ("127.0.0.1:7860:80", 421), ("127.0.0.1:x", 421), ("::1", 421), ("", 421),
        ("192.168.1.5:7860", 421), ("hub.example", 421),
    ],
)  # fmt: skip
def test_only_names_of_this_machine_open_what_only_it_can_reach(host: str, expected: int):
    assert status(LOCAL, host=host) == expected


def test_a_request_without_a_host_or_with_two_is_refused():
    assert status(LOCAL) == 421
    refusal = LOCAL.refusal("GET", [("host", "127.0.0.1"), ("Host", "evil.example")])
    assert refusal is not None
    assert refusal.status == 400


@pytest.mark.parametrize("websocket", [False, True])
@pytest.mark.parametrize(
    ("origin", "expected"),
    [
        ("http://127.0.0.1:8080", 200), ("https://127.0.0.1:8080", 200),
        ("http://127.0.0.1:8081", 403), ("http://127.0.0.1", 403), ("http://localhost:8080", 403), ("https://evil.example", 403), ("null", 403),
        ("file://", 403), ("", 403), ("http://127.0.0.1:8080.evil.example", 403), ("chrome-extension://127.0.0.1:8080", 403), ("127.0.0.1:8080", 403),
    ],
)  # fmt: skip
def test_only_pages_of_the_server_itself_talk_to_it(origin: str, expected: int, websocket: bool):
    assert status(LOCAL, host="127.0.0.1:8080", origin=origin, websocket=websocket) == expected


@pytest.mark.parametrize(
    ("method", "mode", "site", "expected"),
    [
        ("GET", "navigate", "cross-site", 200), ("GET", "navigate", "same-site", 200), ("GET", "navigate", "none", 200),
        ("POST", "cors", "same-origin", 200), ("GET", "no-cors", "cross-site", 403), ("GET", "no-cors", "same-site", 403),
        ("POST", "navigate", "cross-site", 403), ("POST", "no-cors", "cross-site", 403), ("POST", "cors", "same-site", 403), ("GET", "websocket", "cross-site", 403),
    ],
)  # fmt: skip
def test_links_from_elsewhere_open_pages_and_nothing_else(method: str, mode: str, site: str, expected: int):
    assert status(LOCAL, method, host="127.0.0.1:1", sec_fetch_mode=mode, sec_fetch_site=site) == expected


def test_no_navigation_opens_a_websocket():
    given = {"host": "127.0.0.1:1", "sec_fetch_mode": "navigate", "sec_fetch_site": "cross-site"}
    assert status(LOCAL, websocket=True, **given) == 403


def test_a_proxy_that_is_named_may_pass_requests_on_with_its_own_host_or_ours():
    for host in ("hub.example", "hub.example:8443", "localhost:8080"):
        assert status(PROXIED, host=host, origin="https://hub.example", websocket=True) == 200
        assert status(PROXIED, host=host, origin="https://hub.example:8443") == 200
        assert status(PROXIED, host=host, origin="https://nothub.example") == 403
    assert status(PROXIED, host="other.example") == 421
    assert PROXIED.frame_ancestors == "frame-ancestors 'self' http://hub.example:* https://hub.example:*"


def test_a_tunnel_may_have_another_port():
    assert status(LOCAL, host="localhost:9000", origin="http://localhost:9000", websocket=True) == 200


def test_a_space_is_open_to_all_names_and_framed_by_the_hub_but_not_used_by_other_pages():
    assert (
        status(SPACE, "POST", host="room.hf.space", origin="https://room.hf.space", sec_fetch_site="same-origin") == 200
    )
    assert status(SPACE, "POST", host="10.0.0.7:7860", origin="https://room.hf.space") == 200
    assert status(SPACE, "POST", host="room.hf.space", origin="https://evil.hf.space") == 403
    assert SPACE.frame_ancestors.endswith(" https://huggingface.co")
    assert LOCAL.frame_ancestors == "frame-ancestors 'self'"


def test_the_token_becomes_a_cookie_and_leaves_the_address():
    first = PUBLIC.refusal("GET", [("host", "robot:80")], f"token={TOKEN}&room=abc")
    assert first is not None
    headers = dict(first.headers)
    assert (first.status, headers["location"]) == (303, "?room=abc")
    assert headers["set-cookie"] == f"{COOKIE}={TOKEN}; HttpOnly; SameSite=Lax; Path=/"
    assert status(PUBLIC, host="robot:80", cookie=f"other=1; {COOKIE}={TOKEN}") == 200
    assert status(PUBLIC, host="robot:80", cookie=f"{COOKIE}={TOKEN}", websocket=True) == 200


@pytest.mark.parametrize(
    "query",
    ["", "token=", "token=a-toke", "token=b&token=a-token", "&" * 50 + "token=a-token", "token=ä", "token=\udcff"],
)
def test_without_the_token_nothing_is_served(query: str):
    assert status(PUBLIC, query=query, host="robot") == 403
    assert status(PUBLIC, query=query, host="robot", cookie=f"{COOKIE}=wrong") == 403


@pytest.mark.parametrize(
    "other",
    [
        'prefs={"theme":"dark"}',
        "a=b c",
        'a="b',
        "a[]=1",
        "path=/",
        "a",
        "a=\u00e9",
        "=",
        f"{COOKIE}=wrong",
        f"x{COOKIE}=wrong",
    ],
)
def test_cookies_of_other_programs_on_the_host_keep_nobody_out(other: str):
    for listed in (f"{other}; {COOKIE}={TOKEN}", f"{COOKIE}={TOKEN};{other}"):
        assert status(PUBLIC, host="robot:80", cookie=listed) == 200
    assert status(PUBLIC, host="robot:80", cookie=other) == 403
    assert status(PUBLIC, host="robot:80", cookie=f"a={COOKIE}={TOKEN}; {other}") == 403


def test_two_servers_on_one_host_have_different_cookies():
    assert cookie_name(TOKEN) == COOKIE
    both = f"{cookie_name('another')}=another; {COOKIE}={TOKEN}"
    assert status(PUBLIC, host="robot:80", cookie=both) == 200
    assert status(Access(None, "another"), host="robot:81", cookie=both) == 200


def test_the_token_in_the_address_opens_pages_only():
    assert status(PUBLIC, query=f"token={TOKEN}", host="robot", websocket=True) == 403
    assert status(PUBLIC, "POST", f"token={TOKEN}", host="robot") == 403


@pytest.mark.parametrize("room", ["a%0d%0aset-cookie:x", "//evil.example", "ä"])
def test_the_address_after_the_token_is_never_elsewhere(room: str):
    first = PUBLIC.refusal("GET", [("host", "robot")], f"token={TOKEN}&room={room}")
    assert first == Refusal(
        303, "", (("location", "./"), ("set-cookie", f"{COOKIE}={TOKEN}; HttpOnly; SameSite=Lax; Path=/"))
    )


def test_others_need_a_token_of_which_each_is_new():
    assert access_to(local=True) == LOCAL
    tokens = {access_to(local=False).token for _ in range(3)}
    assert len(tokens) == 3
    assert all(token is not None and len(token) == 24 for token in tokens)  # 18 bytes in base64


@pytest.mark.parametrize(
    "text", ["http://hub.example", "hub.example:80", "hub/", "", "a b", "hub.example\n", "*", "'none'; script-src *"]
)
def test_what_is_no_host_name_is_refused(text: str):
    with pytest.raises(ValueError, match="is not a host name"):
        host_name(text)


@pytest.mark.parametrize(
    "text",
    [
        "localhost",
        "127.0.0.1",
        "[::1]",
        "LocalHost",
        "localhost.",
        "a.localhost",
        "127.0.0.2",
        "0.0.0.0",
        "[::]",
        "[::ffff:127.0.0.1]",
    ],
)
def test_names_that_all_programs_of_this_machine_have_are_refused(text: str):
    with pytest.raises(ValueError, match="needs no permission"):
        host_name(text)


def test_host_names_are_compared_in_lower_case():
    assert host_name("Hub.Example") == "hub.example"
    assert host_name("192.168.1.5") == "192.168.1.5"
    assert host_name("localhost.example") == "localhost.example"


def asked(url: str, *headers: str, target: str = "/") -> str:
    """The head of the answer of a server to a request with these headers."""
    place = urlsplit(url)
    assert place.hostname is not None
    with socket.create_connection((place.hostname, place.port or 80), timeout=20) as connection:
        connection.sendall("\r\n".join([f"GET {target} HTTP/1.1", *headers, "", ""]).encode())
        return connection.recv(4096).decode("latin-1").partition("\r\n\r\n")[0]


HANDSHAKE = (
    "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
    "Sec-WebSocket-Protocol: viser-v1.1.1",
)  # fmt: skip


def test_the_viewer_gives_its_scene_to_its_own_page_only():
    with open_window(wall_and_chair((4, 5))) as window:
        own = f"Host: {window.url.removeprefix('http://')}"
        page = asked(window.url, own)
        assert page.startswith("HTTP/1.1 200")
        policy = next(line for line in page.splitlines() if line.startswith("Content-Security-Policy: "))
        place = window.url.removeprefix("http://")
        assert policy.endswith(f"connect-src 'self' data: blob: ws://{place} wss://{place}; frame-ancestors 'self'")
        assert "default-src 'self' data: blob:;" in policy
        for query in (
            "websocket=wss://evil.example",
            "a=1&playbackPath=https://evil.example/a",
            "%77ebsocket=ws://evil.example",
        ):
            assert asked(window.url, own, target=f"/?{query}").startswith(
                "HTTP/1.1 303"
            )  # their scripts would run here
        assert asked(window.url, own, f"Origin: {window.url}", *HANDSHAKE).startswith("HTTP/1.1 101")
        assert asked(window.url, own, "Origin: https://evil.example", *HANDSHAKE).startswith("HTTP/1.1 403")
        assert asked(window.url, own, "Origin: http://127.0.0.1:1", *HANDSHAKE).startswith("HTTP/1.1 403")
        assert asked(window.url, "Host: evil.example", *HANDSHAKE).startswith("HTTP/1.1 421")
        assert asked(window.url, "Host: evil.example").startswith("HTTP/1.1 421")
        assert asked(window.url, own, target=f"/{5000 * 'a'}").startswith(
            "HTTP/1.1 404"
        )  # longer than a file's name may be
        assert asked(window.url, own, "Sec-Fetch-Site: cross-site", "Sec-Fetch-Mode: no-cors").startswith(
            "HTTP/1.1 403"
        )


def test_a_viewer_for_others_needs_its_token():
    with open_window(wall_and_chair((4, 5)), access=PUBLIC) as window:
        address, _, query = window.url.partition("/?")
        assert query == f"token={TOKEN}"
        own = f"Host: {address.removeprefix('http://')}"
        assert asked(address, own).startswith("HTTP/1.1 403")
        assert asked(address, own, *HANDSHAKE).startswith("HTTP/1.1 403")
        first = asked(address, own, target=f"/?{query}")
        assert first.startswith("HTTP/1.1 303")
        assert f"set-cookie: {COOKIE}={TOKEN}; HttpOnly; SameSite=Lax" in first
        for headers in (HANDSHAKE, ()):
            answer = asked(address, own, f"Cookie: {COOKIE}={TOKEN}", *headers)
            assert answer.startswith("HTTP/1.1 101" if headers else "HTTP/1.1 200")
