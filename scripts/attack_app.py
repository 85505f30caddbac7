"""Attack the app and the viewer on this machine, and print what got through.

    pip install -e '.[app]'
    python scripts/attack_app.py [--few | --rooms]

Both are started here, on loopback, in a temporary folder beside a secret, and get a bounded number of requests. --rooms also lets the real worker make rooms of zips that
point elsewhere (minutes); --few is a tenth of the requests (seconds). Exit code 1 if anything got through.
"""

from __future__ import annotations

import io
import json
import os
import secrets
import shutil
import socket
import sys
import threading
import time
import urllib.parse
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stderr, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image

from semgs.app import serving
from semgs.app.door import is_known
from semgs.app.jobs import Jobs
from semgs.app.limits import Limits
from semgs.data.demo_scene import demo_scene
from semgs.viewer.server import serving as viewer_serving

LIMITS = Limits(file_bytes=2_000_000, total_bytes=3_000_000, uploads=40, uploads_bytes=20_000_000, photos=5)
HEADER_SECONDS = SENDING_SECONDS = 2.0
UNREAD = 20
HALF_OPEN = 60
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
PATIENCE = 20.0
NO_WORKER = (sys.executable, "-c", "import sys; sys.stdin.readline()")
SLOW_WORKER = (
    sys.executable,
    "-c",
    'import sys, time; sys.stdin.readline(); print(\'{"stage": "a"}\', file=sys.stderr, flush=True); time.sleep(100)',
)
FOLLOWERS = 120

FOREIGN = (
    {"origin": "https://evil.example"}, {"origin": "null"}, {"origin": "http://127.0.0.1:1"}, {"origin": "http://localhost:{port}"},
    {"sec-fetch-site": "cross-site"}, {"sec-fetch-site": "same-site", "sec-fetch-mode": "cors"}, {"host": "evil.example:{port}"}, {"host": "evil.example"},
    {"host": "127.0.0.1.evil.example:{port}"}, {"host": "[::ffff:127.0.0.1]:{port}"}, {"host": ""},
)  # fmt: skip
"""Headers of requests that a page elsewhere lets a browser send."""


HONEST = "nothing wrong"
"""A zip of which a room is made, so that the others fail for what is wrong with them."""


@dataclass
class Report:
    """What was tried, and what got through."""

    tried: int = 0
    through: list[str] = field(default_factory=list)

    def note(self, attack: str, failed: bool, got: object = "") -> None:
        """Count an attack; one that did not fail got through."""
        self.tried += 1
        if not failed:
            self.through.append(f"{attack}: {str(got)[:300]}")


@dataclass(frozen=True)
class Target:
    """A running app.

    Attributes:
        port: of the app.
        folder: of the app, with uploads and rooms.
        secret: content of a file of this machine that must not leave it.
        outside: that file, a picture.
        application: of FastAPI, with gradio's routes.
        few: whether a tenth of the requests is enough.
    """

    port: int
    folder: Path
    secret: bytes
    outside: Path
    application: Any
    few: bool = False

    @property
    def uploads(self) -> Path:
        """The folder for what browsers send."""
        return self.folder / "uploads"

    def ask(
        self,
        method: str,
        path: str,
        body: bytes = b"",
        headers: dict[str, str] | None = None,
        port: int | None = None,
        until: bytes = b"text/event-stream",
        patience: float = PATIENCE,
    ) -> tuple[int, bytes]:
        """Send one request as it is written, and return status and body, as far as they come in time; of a stream until some bytes came."""
        own = {"host": f"127.0.0.1:{self.port}", "connection": "close"}
        given = {**own, **({"content-length": str(len(body))} if body else {})}
        given |= {name: value.format(port=port or self.port) for name, value in (headers or {}).items()}
        lines = [f"{method} {path} HTTP/1.1", *(f"{name}: {value}" for name, value in given.items()), "", ""]
        answer, end = b"", time.monotonic() + PATIENCE
        with socket.create_connection(("127.0.0.1", port or self.port), timeout=patience) as connection:
            try:
                connection.sendall("\r\n".join(lines).encode("latin-1", "replace") + body)
                while part := connection.recv(65536):
                    answer += part
                    if len(answer) > 3_000_000 or until in answer or time.monotonic() > end:
                        break
            except OSError:
                pass
        head, _, content = answer.partition(b"\r\n\r\n")
        words = head.split()
        return (int(words[1]) if len(words) > 1 and words[1].isdigit() else 0), content

    def upload(self, name: str, content: bytes, headers: dict[str, str] | None = None) -> tuple[int, bytes]:
        """Upload a file as the page does."""
        return self.ask("POST", "/gradio_api/upload", *_form([("files", name, content)], headers))

    def join(self, body: Any) -> tuple[int, bytes]:
        """Call a function of the page."""
        text = json.dumps(body).encode()
        return self.ask("POST", "/gradio_api/queue/join", text, {"content-type": "application/json"})

    def leaks(self) -> list[str]:
        """Files of the app that hold the secret."""
        found = []
        for path in self.folder.rglob("*"):
            if path.is_file() and not path.is_symlink() and self.secret in path.read_bytes():
                found.append(str(path))
        return found


def _form(
    parts: Sequence[tuple[str, str | None, bytes]], headers: dict[str, str] | None = None
) -> tuple[bytes, dict[str, str]]:
    """Body and headers of a form with files (with a name) and fields (without)."""
    edge = secrets.token_hex(8)
    body = b""
    for field_name, name, content in parts:
        file = "" if name is None else f'; filename="{name}"'
        body += (
            f'--{edge}\r\nContent-Disposition: form-data; name="{field_name}"{file}\r\n\r\n'.encode()
            + content
            + b"\r\n"
        )
    return body + f"--{edge}--\r\n".encode(), {
        "content-type": f"multipart/form-data; boundary={edge}",
        **(headers or {}),
    }


@contextmanager
def running(folder: Path, worker: Sequence[str], few: bool = False) -> Iterator[Target]:
    """The app on loopback, in this process."""
    secret = secrets.token_hex(16).encode()
    outside = folder / "private" / "secret.jpg"
    outside.parent.mkdir(parents=True)
    buffer = io.BytesIO()
    Image.fromarray(np.random.default_rng(7).integers(0, 255, (240, 320, 3), np.uint8)).save(
        buffer, "JPEG", comment=secret
    )
    outside.write_bytes(buffer.getvalue())
    app_folder = folder / "app"
    jobs = Jobs(app_folder / "rooms", worker, LIMITS, uploads=app_folder / "uploads")
    app = serving.application(jobs)
    try:
        ports = [_serve(app)]
        target = Target(ports[0], app_folder, secret, outside, app._app, few)
        target.ask("GET", "/")  # gradio answers calls only once somebody has opened the page
        yield target
    finally:
        jobs.close()


def _serve(app: Any) -> int:
    """Serve until the process ends. Returns the port, once it answers."""
    from uvicorn import Server

    Server.capture_signals = lambda self: nullcontext()  # type: ignore[method-assign,assignment,return-value] # signals belong to the main thread
    ports: list[int] = []
    threading.Thread(target=serving.serve, args=(app, "127.0.0.1", 0, ports.append), daemon=True).start()
    while not ports or not _open(ports[0]):
        time.sleep(0.1)
    return ports[0]


def _open(port: int) -> bool:
    """Whether a port answers."""
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
    except OSError:
        return False
    return True


def call_with_paths(target: Target, report: Report) -> None:
    """Give paths of this machine as uploaded files, to every function of the page, in every place."""
    inside = target.uploads / "abc"
    inside.mkdir()
    (inside / "link.jpg").symlink_to(target.outside)
    (target.uploads / "all").symlink_to("/")
    os.mkfifo(inside / "pipe.jpg")
    os.link(target.outside, target.folder / "beside.jpg")
    paths = [
        str(target.outside), "/etc/passwd", "/proc/self/environ", "/proc/self/root/etc/passwd", "/dev/zero", "/dev/stdin", "/dev/fd/0", f"{inside}/../../../private/secret.jpg",
        str(inside / "link.jpg"), str(target.uploads / f"all{target.outside}"), str(inside / "pipe.jpg"), str(target.folder / "beside.jpg"), "../private/secret.jpg",
        f"file://{target.outside}", f"http://127.0.0.1:{target.port}/", "~/.ssh/id_rsa", str(inside), str(target.uploads), f"{inside}/a\0.jpg", "x" * 9000, "", "\\\\host\\share",
    ]  # fmt: skip
    options = [2, False, "included network", "", "network", 0, 0, 0]
    for path in paths[:: 5 if target.few else 1]:
        for meta in ({"_type": "gradio.FileData"}, {}):
            file = {"path": path, "orig_name": "a.jpg", "url": path, "meta": meta, "is_stream": False}
            places = {
                "as a photo": (0, [[file, file], *options]),
                "as an option": (0, [[], file, *options[1:]]),
                "in a list in a list": (0, [[[file]], *options]),
                "as a name of a room": (2, [file]),
                "as a text": (2, [path]),
                "as a component": (4, [file]),
                "beside": (6, []),
            }
            for place, (number, data) in places.items():
                body = {
                    "data": data,
                    "fn_index": number,
                    "session_hash": "attack",
                    "trigger_id": None,
                    "event_data": file,
                }
                status, answer = target.join(body)
                harmless = place in ("as a text", "beside")  # a text is a text, and what no function takes is left out
                report.note(f"{path[:60]!r} {place}", harmless or status in (400, 422), (status, answer))
    time.sleep(1)
    report.note(
        "a secret in the app's folder after calls",
        not [one for one in target.leaks() if "beside" not in one],
        target.leaks(),
    )
    (target.folder / "beside.jpg").unlink()
    for left in (inside / "link.jpg", inside / "pipe.jpg", target.uploads / "all"):
        left.unlink()


def call_gradio_itself(target: Target, report: Report) -> None:
    """Give gradio a file of this machine, with no door in front."""
    port = _serve(target.application)
    target.ask("GET", "/", b"", {"host": f"127.0.0.1:{port}"}, port)
    file = {"path": str(target.outside), "orig_name": "a.jpg", "meta": {"_type": "gradio.FileData"}}
    data = [[file, file], 2, False, "included network", "", "network", 0, 0, 0]
    body = json.dumps({"data": data, "fn_index": 0, "session_hash": "itself", "trigger_id": None}).encode()
    headers = {"host": f"127.0.0.1:{port}", "content-type": "application/json"}
    status, answer = target.ask("POST", "/gradio_api/queue/join", body, headers, port)
    report.note("gradio answers calls", status == 200, (status, answer))
    end, said = time.monotonic() + PATIENCE, b""
    while b"process_completed" not in said and time.monotonic() < end:
        said += target.ask(
            "GET", "/gradio_api/queue/data?session_hash=itself", b"", headers, port, b"process_completed"
        )[1]
    report.note("gradio's own check", b'"success":false' in said and not target.leaks(), (said, target.leaks()))


def call_routes(target: Target, report: Report) -> None:
    """Ask for every route of the installed gradio that the page does not use, with every method."""
    listed = sorted({path for path in _routes(target.application) if path})
    report.note("gradio's routes are listed", len(listed) > 40, listed)
    values = {
        "{path:path}": "etc/passwd",
        "{path_or_url:path}": str(target.outside),
        "{url_path:path}": f"http://127.0.0.1:{target.port}/",
    }
    for route in listed:
        path = route
        for name, value in values.items():
            path = path.replace(name, value)
        while "{" in path:
            path = path[: path.index("{")] + "abc" + path[path.index("}") + 1 :]
        variants = dict.fromkeys((path, path + "/", "/" + path, path.replace("/", "//"), path + "?url=/etc/passwd"))
        for variant in [path] if target.few else variants:
            for method in ("GET", "POST") if target.few else METHODS:
                if not is_known(method, urllib.parse.unquote(variant.partition("?")[0])):
                    status, answer = target.ask(method, variant)
                    report.note(f"{method} {variant}", status in (404, 400), (status, answer))
        # Starlette takes what a proxy says away from the beginning of a path.
        place = "/rooms/" + 20 * "a"
        status, answer = target.ask("GET", place + path, b"", {"x-forwarded-prefix": place})
        report.note(f"GET {path} behind the place of a room", status == 404, (status, answer))


def _routes(application: Any) -> Iterator[str]:
    """The paths of an application, and of what is mounted and included in it."""
    for route in application.routes:
        if hasattr(route, "original_router"):  # FastAPI's, of what include_router adds
            yield from _routes(route.original_router)
        elif hasattr(getattr(route, "app", None), "routes") and hasattr(route, "path"):
            yield from (f"{route.path.rstrip('/')}{path}" for path in _routes(route.app))
        elif hasattr(route, "path"):
            yield route.path


def call_from_elsewhere(target: Target, report: Report) -> None:
    """Upload, call and read as a page elsewhere would let a browser do."""
    for headers in FOREIGN:
        asked = {
            "an upload": target.upload("a.jpg", b"x", headers),
            "a call": target.ask("POST", "/gradio_api/queue/join", b"{}", {"content-type": "text/plain", **headers}),
            "a page": target.ask("GET", "/", b"", {"sec-fetch-mode": "no-cors", **headers}),
            "a stream": target.ask("GET", "/gradio_api/queue/data?session_hash=a", b"", headers),
            "a preflight": target.ask(
                "OPTIONS", "/gradio_api/upload", b"", {"access-control-request-method": "POST", **headers}
            ),
        }
        for what, (status, answer) in asked.items():
            report.note(f"{what} with {headers}", status in (400, 403, 404, 421), (status, answer))
    upgrade = {
        "connection": "Upgrade",
        "upgrade": "websocket",
        "sec-websocket-version": "13",
        "sec-websocket-key": "AAAAAAAAAAAAAAAAAAAAAA==",
    }
    status, answer = target.ask("GET", "/gradio_api/queue/join", b"", upgrade)
    report.note("a WebSocket", status != 101, (status, answer))


def upload_too_much(target: Target, report: Report) -> None:
    """Upload more, longer, and other things than the page does, and names that are paths."""
    for name in (
        "../../out.jpg",
        "/etc/out.jpg",
        "..\\..\\out.jpg",
        "a/../../out.jpg",
        "\0.jpg",
        "x" * 3000,
        ".",
        "..",
        "",
        "con.jpg",
        "-rf.jpg",
        "a\nb.jpg",
    ):
        status, answer = target.upload(name, b"content")
        stray = [path for path in target.folder.parent.rglob("*out.jpg") if not path.is_relative_to(target.uploads)]
        report.note(
            f"an upload named {name[:20]!r}", status in (200, 400, 413, 422, 500) and not stray, (status, answer, stray)
        )
    many = [("files", f"{number}.jpg", b"x") for number in range(30)]
    attacks = {
        "too many files at once": target.ask("POST", "/gradio_api/upload", *_form(many)),
        "a field in place of a file": target.ask(
            "POST", "/gradio_api/upload", *_form([("files", None, bytes(2_500_000))])
        ),
        "a large file": target.upload("a.jpg", bytes(2_500_000)),
        "more than fits into a request": target.upload("a.jpg", bytes(3_100_000)),
        "a length that is a lie": target.ask(
            "POST",
            "/gradio_api/upload",
            bytes(3_100_000),
            {"content-length": "100", "content-type": "multipart/form-data; boundary=a"},
        ),
        "a negative length": target.ask("POST", "/gradio_api/upload", b"x", {"content-length": "-1"}),
        "two lengths": target.ask("POST", "/gradio_api/upload", b"x", {"content-length": "1\r\ncontent-length: 2"}),
        "no form": target.ask("POST", "/gradio_api/upload", b"x", {"content-type": "text/plain"}),
        "no boundary": target.ask("POST", "/gradio_api/upload", b"x", {"content-type": "multipart/form-data"}),
    }
    for what, (status, answer) in attacks.items():
        report.note(what, status in (400, 413, 422, 500, 507, 0), (status, answer))
    statuses = [target.upload(f"{number}.jpg", secrets.token_bytes(1_900_000))[0] for number in range(14)]
    stored = sum(path.stat().st_size for path in target.uploads.rglob("*") if path.is_file())
    report.note("filling the folder of uploads", 507 in statuses and stored <= LIMITS.uploads_bytes, (statuses, stored))


def climb_out_of_rooms(target: Target, report: Report) -> None:
    """Ask for files outside a room, by its address."""
    room = target.folder / "rooms" / ("a" * 20) / "room"
    room.mkdir(parents=True)
    (room / "link.jpg").symlink_to(target.outside)
    (room / ".semgs").write_bytes(target.secret)
    climbs = ("../", "..%2f", "%2e%2e/", "%252e%252e/", "..\\", "..%5c", "....//", "./../", "renders/../../", "/")
    for climb in climbs:
        for times in (1, 3, 6):
            for end in ("private/secret.jpg", "etc/passwd", "uploads/", ".semgs", "link.jpg"):
                status, answer = target.ask("GET", f"/rooms/{'a' * 20}/{climb * times}{end}")
                report.note(
                    f"a room's file {climb * times}{end}",
                    status in (400, 404) and target.secret not in answer,
                    (status, answer),
                )
    shutil.rmtree(room.parent)  # what was laid out here is not what a room holds


def hold_connections(target: Target, report: Report) -> None:
    """Open connections that never send a request, and requests whose body never comes."""
    begun = (
        b"",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n",
        b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: keep-alive\r\n\r\nGET ",
    )
    connections = []
    for number in range(HALF_OPEN):
        connections.append(socket.create_connection(("127.0.0.1", target.port), timeout=PATIENCE))
        connections[-1].sendall(begun[number % len(begun)])
    status, _ = target.ask("GET", "/theme.css")
    report.note("the page beside half-open connections", status == 200, status)
    time.sleep(HEADER_SECONDS + 2)
    closed = 0
    for one in connections:
        one.settimeout(0.5)
        try:
            while data := one.recv(65536):
                del data
            closed += 1
        except OSError as error:
            closed += not isinstance(error, TimeoutError)
        one.close()
    report.note("half-open connections are closed", closed == HALF_OPEN, f"{closed} of {HALF_OPEN}")


def read_no_answer(target: Target, report: Report) -> None:
    """Ask for a large file very often, and never read it."""
    import gradio

    files = Path(gradio.__file__).parent.glob("templates/frontend/assets/*.js")
    largest = f"/assets/{max(files, key=lambda file: file.stat().st_size).name}"
    connections = []
    for _ in range(UNREAD):
        one = socket.socket()
        one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        one.connect(("127.0.0.1", target.port))
        one.sendall(f"GET {largest} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode() * (1 + len(connections)))
        connections.append(one)
    time.sleep(SENDING_SECONDS + 3)
    cut = 0
    for one in connections:
        one.settimeout(2)
        with suppress(TimeoutError):
            try:
                while one.recv(1 << 20):
                    pass
            except ConnectionError:
                cut += 1
        one.close()
    report.note("answers that are never read are given up", cut == UNREAD, f"{cut} of {UNREAD} of {largest}")


def follow_too_often(target: Target, report: Report) -> None:
    """Let very many calls wait for one room, without reading what they say."""
    with running(target.folder / "waiting", SLOW_WORKER) as other:
        options = [2, False, "included network", "", "network", 0, 0, 0]
        call = {"data": options, "fn_index": 1, "trigger_id": 1}
        for session in ("working", "waiting"):
            other.join({**call, "session_hash": session})
            time.sleep(1.5)
        # The page of the room that is made is left, so that nothing changes for the others.
        other.ask("GET", "/gradio_api/queue/data?session_hash=working", until=b"data:")
        for number in range(FOLLOWERS):
            which = {"fn_index": 0, "data": [None, *options]} if number % 2 else {}
            other.join({**call, **which, "session_hash": "waiting"})
        time.sleep(2)
        for what, ask in {
            "the page": lambda: other.ask("GET", "/theme.css"),
            "an upload": lambda: other.upload("a.jpg", b"x"),
            "a call": lambda: other.join({**call, "session_hash": "third"}),
        }.items():
            start = time.monotonic()
            status, answer = ask()
            soon = time.monotonic() - start < 5
            report.note(f"{what} beside {FOLLOWERS} calls that wait", status == 200 and soon, (status, answer))
        said = other.ask("GET", "/gradio_api/queue/data?session_hash=third", until=b"before yours")[1]
        report.note("another page follows its room", b"2 rooms are before yours" in said, said[-300:])


def open_viewer(target: Target, report: Report) -> None:
    """Read the scene of a viewer as a page elsewhere would."""
    handshake = {
        "connection": "Upgrade", "upgrade": "websocket", "sec-websocket-version": "13", "sec-websocket-key": "AAAAAAAAAAAAAAAAAAAAAA==",
        "sec-websocket-protocol": "viser-v1.1.1",
    }  # fmt: skip
    with viewer_serving() as server:
        port = server.get_port()
        own = {"host": f"127.0.0.1:{port}"}
        for headers in FOREIGN:
            for what, more in (("the viewer", {}), ("the viewer's WebSocket", handshake)):
                if (
                    what == "the viewer"
                    and "sec-fetch-site" not in headers
                    and "host" not in headers
                    and "origin" not in headers
                ):
                    continue
                status, answer = target.ask("GET", "/", b"", {**own, **more, **headers}, port)
                report.note(f"{what} with {headers}", status in (400, 403, 421), (status, answer))
        for path in (
            "/../../../../etc/passwd",
            "/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd",
            "//etc/passwd",
            "/..%5c..%5cetc%5cpasswd",
        ):
            status, answer = target.ask("GET", path, b"", own, port)
            report.note(f"the viewer's file {path}", status == 404 and b"root:" not in answer, (status, answer))


def make_rooms(target: Target, report: Report) -> None:
    """Drop zips of scenes that point elsewhere, and look for the secret in what the worker made."""
    for name, members in _zips(target.outside).items():
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as archive:
            for member, content in members:
                archive.writestr(member, content)
        status, answer = target.upload(f"{name}.zip", buffer.getvalue())
        path = json.loads(answer)[0] if status == 200 else ""
        data = [
            [{"path": path, "orig_name": f"{name}.zip", "meta": {"_type": "gradio.FileData"}}],
            2,
            False,
            "included network",
            "",
            "network",
            0,
            0,
            0,
        ]
        session = secrets.token_hex(5)
        status, answer = target.join({"data": data, "fn_index": 0, "session_hash": session, "trigger_id": 6})
        stream = f"/gradio_api/queue/data?session_hash={session}"
        said = target.ask("GET", stream, until=b"close_stream", patience=300)[1] if status == 200 else b""
        made = sorted((target.folder / "rooms").glob("*/room/room.json"))
        found = b"iframe" in said, b"status error" in said, len(made)
        expected = (
            (True, False, 1) if name == HONEST else (False, True, 1)
        )  # the honest one comes first, and its room stays
        report.note(f"a room of a zip with {name}", found == expected and not target.leaks(), (found, said[-300:]))


def _zips(outside: Path) -> dict[str, list[tuple[Any, bytes]]]:
    """Members of zips that point to a picture outside."""
    scene = demo_scene()
    transforms = json.loads((scene / "transforms.json").read_text())
    photos = [
        (f"{path.relative_to(scene)}", path.read_bytes())
        for path in sorted(scene.rglob("*"))
        if path.suffix in (".jpg", ".png")
    ]
    zips: dict[str, list[tuple[Any, bytes]]] = {HONEST: [("transforms.json", json.dumps(transforms).encode()), *photos]}
    climbing = os.path.relpath(outside, "/tmp/a/b/c/d/e/f")
    for key in ("file_path", "depth_file_path", "label_file_path", "mask_path", "instance_file_path"):
        for kind, place in (
            ("an absolute", str(outside)),
            ("a climbing", f"../../../../../../../../../..{outside}"),
            ("a relative", climbing),
        ):
            changed = json.loads(json.dumps(transforms))
            for number, frame in enumerate(changed["frames"]):
                frame[key] = place if key != "file_path" or number == 0 else frame[key]
            zips[f"{kind} {key}"] = [("transforms.json", json.dumps(changed).encode()), *photos]
    for kind, mode in (
        ("a symbolic link", 0o120777),
        ("a device", 0o020666),
        ("a pipe", 0o010666),
        ("a socket", 0o140666),
    ):
        member = zipfile.ZipInfo("images/000.jpg")
        member.create_system, member.external_attr = 3, mode << 16
        zips[kind] = [("transforms.json", json.dumps(transforms).encode()), (member, str(outside).encode())]
    for name in ("/tmp/out.jpg", "../out.jpg", "a/../../out.jpg", "C:\\out.jpg", "..\\out.jpg"):
        zips[f"a member {name!r}"] = [(name, b"x"), ("transforms.json", b"{}")]
    return zips


def main(arguments: Sequence[str]) -> int:
    """Run all attacks. Returns 1 if one got through."""
    report = Report()
    serving.HEADER_SECONDS, serving.SENDING_SECONDS = HEADER_SECONDS, SENDING_SECONDS
    said = io.StringIO()
    rooms, few = "--rooms" in arguments, "--few" in arguments
    worker = [sys.executable, "-m", "semgs.app.worker", "--cold"] if rooms else NO_WORKER
    attacks = (
        call_with_paths,
        call_gradio_itself,
        call_routes,
        call_from_elsewhere,
        climb_out_of_rooms,
        open_viewer,
        *(() if few else (hold_connections, read_no_answer)),
        *((make_rooms,) if rooms else ()),
        upload_too_much,
        follow_too_often,
    )
    with (
        TemporaryDirectory(prefix="semgs-") as folder,
        redirect_stderr(said),
        running(Path(folder), worker, few) as target,
    ):
        for attack in attacks:
            before, start = report.tried, time.monotonic()
            attack(target, report)
            print(
                f"{attack.__name__.replace('_', ' ')}: {report.tried - before} tried, {time.monotonic() - start:.0f} s",
                flush=True,
            )
        report.note("tracebacks in the terminal", "Traceback" not in said.getvalue(), said.getvalue()[-2000:])
        report.note("lines in the terminal", said.getvalue().count("\n") < 60, said.getvalue()[:2000])
    print(f"{report.tried} attacks, {len(report.through)} got through")
    print(*report.through, sep="\n")
    return 1 if report.through else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
