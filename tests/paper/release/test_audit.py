"""The audit of a release: a package that nobody looked up is no success, and the base set holds no GPL."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from paper.release.audit import Audit, base_set, bundled, is_gpl, licence, vulnerabilities, without_hashes
from semgs.files.errors import InputError


def answer(*packages: dict) -> str:
    return json.dumps({"dependencies": list(packages), "fixes": []})


SOUND = {"name": "numpy", "version": "2.4.0", "vulns": []}
VULNERABLE = {"name": "pillow", "version": "9.0.0", "vulns": [{"id": "PYSEC-2022-10"}, {"id": "CVE-2022-22817"}]}
UNKNOWN = {"name": "jinja2", "skip_reason": "Dependency not found on PyPI and could not be audited: jinja2 (3.1.6)"}


@pytest.mark.parametrize(
    ("packages", "code", "lines"),
    [
        ((SOUND,), 0, ["audited: 1 packages"]),
        ((SOUND, UNKNOWN), 3, ["not audited: 1 packages: jinja2", "audited: 1 packages"]),
        ((UNKNOWN,), 3, ["not audited: 1 packages: jinja2", "audited: 0 packages"]),
        ((), 3, ["audited: 0 packages"]),
        (
            (VULNERABLE, UNKNOWN),
            1,
            [
                "vulnerable: pillow 9.0.0: PYSEC-2022-10, CVE-2022-22817",
                "not audited: 1 packages: jinja2",
                "audited: 1 packages",
            ],
        ),
    ],
    ids=["all are known and sound", "one is unknown", "an index without the service", "nothing", "one is vulnerable"],
)
def test_only_packages_that_were_looked_up_and_are_sound_pass(packages, code: int, lines: list[str]):
    found = Audit.of(answer(*packages))
    assert (found.exit_code, found.lines) == (code, lines)


@pytest.mark.parametrize("printed", ["", "no JSON", "[]", '{"dependencies": [{}]}'])
def test_something_else_than_an_answer_is_refused(printed: str):
    with pytest.raises(ValueError, match="something else than its JSON"):
        Audit.of(printed)


def test_without_an_answer_the_last_line_of_the_tool_says_why(monkeypatch: pytest.MonkeyPatch):
    done = subprocess.CompletedProcess([], 1, stdout="", stderr="Looking up\nno connection to the service\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: done)
    with pytest.raises(InputError) as caught:
        vulnerabilities(Path("pins.txt"))
    assert (
        str(caught.value)
        == "pins.txt: expected an answer of the vulnerability service, found no connection to the service"
    )


def test_a_pin_without_a_hash_is_named():
    lock = "# made by uv\nnumpy==2.4.0 \\\n    --hash=sha256:aa\nrich==14.0.0\nscipy==1.17.1 \\\n    --hash=sha256:bb\n"
    assert without_hashes(lock) == ["rich==14.0.0"]


@pytest.mark.parametrize(
    ("text", "gpl"),
    [
        ("GPL-2.0-or-later", True),
        ("GNU General Public License v3 (GPLv3)", True),
        ("LGPL-2.1-or-later", False),
        ("GNU Lesser General Public License v3 (LGPLv3)", False),
        ("GPL-3.0 with the GCC runtime exception", False),
        ("LGPL-3.0 or GPL-2.0", False),
        ("Public Domain, BSD License, GNU General Public License (GPL)", False),
        ("BSD-3-Clause", False),
    ],
)
def test_the_gpl_is_told_from_licences_that_resemble_it(text: str, gpl: bool):
    assert is_gpl(text) is gpl


def test_the_base_set_has_what_we_require_and_nothing_under_the_gpl():
    base = base_set()
    assert {"numpy", "torch", "opencv-python-headless", "typing-extensions"} <= base
    assert not {"matplotlib", "av", "pillow-heif", "pytest"} & base
    assert [name for name in base if is_gpl(licence(name))] == []
    inside = [(name.lower().replace("_", "-"), library, text) for name, library, text in bundled()]
    assert [one for one in inside if one[0] in base and is_gpl(one[2])] == []
