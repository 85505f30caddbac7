"""Other ways to a server of this machine: a port that is passed on, as SSH does, and a proxy with a name of its own."""

from __future__ import annotations

import re
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


@contextmanager
def tunnel_to(port: int, host: str | None = None, prefix: str = "") -> Iterator[int]:
    """Another port of this machine that passes everything on, until the block ends.

    Args:
        port: of the server.
        host: written into the Host header, as some proxies do; None leaves it.
        prefix: path that the proxy has for the server, which it takes away from addresses and names in a header.
    """

    def rewritten(data: bytes) -> bytes:
        if b" HTTP/1.1\r\n" in data and host is not None:
            data = re.sub(rb"(?i)\r\nhost: [^\r]*", b"\r\nHost: " + host.encode(), data, count=1)
        if prefix:
            start = rb"^((?:GET|POST|HEAD) )" + re.escape(prefix.encode()) + rb"(/[^ ]* HTTP/1\.1\r\n)"
            data = re.sub(start, rb"\1\2X-Forwarded-Prefix: " + prefix.encode() + b"\r\n", data, count=1)
        return data

    listening = socket.create_server(("127.0.0.1", 0))
    open_sockets, threads = [listening], list[threading.Thread]()

    def accept() -> None:
        while True:
            try:
                near, _ = listening.accept()
            except OSError:  # shut down
                return
            far = socket.create_connection(("127.0.0.1", port))
            open_sockets.extend((near, far))
            for ends in ((near, far, rewritten), (far, near, bytes)):
                threads.append(threading.Thread(target=_pass, args=ends, daemon=True))
                threads[-1].start()

    threads.append(threading.Thread(target=accept, daemon=True))
    threads[0].start()
    try:
        yield listening.getsockname()[1]
    finally:
        for one in open_sockets:
            with suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)
        for thread in threads:
            thread.join()
        for one in open_sockets:
            one.close()


def _pass(source: socket.socket, target: socket.socket, rewritten: Callable[[bytes], bytes]) -> None:
    """Pass on what comes, until one side closes."""
    with suppress(OSError):
        while data := source.recv(65536):
            target.sendall(rewritten(data))
    for one in (source, target):
        with suppress(OSError):
            one.shutdown(socket.SHUT_RDWR)
