"""Addresses that servers listen on: who can reach them, and what opens them in a browser."""

from __future__ import annotations

import socket

import pytest

from semgs.cli.commands.scenes.app import App
from semgs.viewer.server import is_this_machine, url_of_address


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1"])
def test_only_this_machine_reaches_its_own_names(host: str) -> None:
    assert is_this_machine(host)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.1", "example.org"])
def test_others_reach_any_other_address(host: str) -> None:
    assert not is_this_machine(host)


@pytest.mark.parametrize(
    ("host", "url"),
    [
        ("localhost", "http://localhost:80"),
        ("192.0.2.1", "http://192.0.2.1:80"),
        ("::1", "http://[::1]:80"),
        ("0.0.0.0", "http://a-machine:80"),
        ("::", "http://a-machine:80"),
    ],
)
def test_a_browser_opens_the_url(host: str, url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(socket, "gethostname", lambda: "a-machine")
    assert url_of_address(host, 80) == url


def test_the_app_prints_an_ipv6_address_in_brackets(capsys: pytest.CaptureFixture[str]) -> None:
    App(host="2001:db8::1")._say(7860, "a-token")
    assert "Open http://[2001:db8::1]:7860/?token=a-token in a browser." in capsys.readouterr().out
