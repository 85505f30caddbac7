"""Addresses that servers listen on: who can reach them, and what opens them in a browser."""

from __future__ import annotations

import socket

from semgs.viewer.server import EVERY_ADDRESS, LOOPBACK

EVERY_ADDRESS_6 = "::"


def is_this_machine(host: str) -> bool:
    """Whether only this machine can reach an address."""
    return host in (LOOPBACK, "localhost", "::1")


def url_of_address(host: str, port: int) -> str:
    """What to open in a browser: the name of this machine if it listens on every address, and IPv6 in brackets."""
    if host in (EVERY_ADDRESS, EVERY_ADDRESS_6):
        host = socket.gethostname()
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
