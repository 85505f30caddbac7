"""What a server says of failures: one line, of the same place once a minute."""

from __future__ import annotations

import logging

import pytest

from semgs.viewer import failures
from semgs.viewer.failures import quieten_libraries


def test_what_libraries_log_is_one_line_of_each(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(failures, "_told", {})
    monkeypatch.setattr(logging, "lastResort", logging.lastResort)
    quieten_libraries()
    for number in range(3):
        logging.getLogger("parts.of.forms").warning("Expected %d\nat \x1b[31m", number)
    try:
        raise ValueError("inner")
    except ValueError:
        logging.getLogger("sockets").exception("failed")
    logging.getLogger("sockets.info").info("nothing")
    assert capsys.readouterr().err == "semgs: parts.of.forms: Expected 0 at \\x1b[31m\nsemgs: sockets: failed\n"
