"""Audit what a release installs: known vulnerabilities, hashes, consistency and licences.

    python -m paper.release audit [--lock requirements.lock]

The lock file lists every package of the base set and all extras with the hashes of its files, at the versions of constraints.txt. Vulnerabilities
are looked up by pip-audit. A package that its service does not know is not audited, and that must not look like success: the exit code is 3.
"""

from __future__ import annotations

import importlib.metadata
import json
import re
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement

from paper.release.pins import ROOT, resolved
from semgs.files.errors import InputError

VULNERABLE, NOT_AUDITED = 1, 3
"""Exit codes: a known vulnerability, broken requirements or a GPL licence in the base set; packages that could not be looked up."""

BUNDLED = {
    "libx264": "GPL-2.0-or-later", "libx265": "GPL-2.0-or-later", "libavcodec": "LGPL-2.1-or-later; GPL with libx264 or libx265",
    "libmp3lame": "LGPL-2.0-or-later", "libheif": "LGPL-3.0", "libde265": "LGPL-3.0", "libgmp": "LGPL-3.0 or GPL-2.0", "libgnutls": "LGPL-2.1-or-later",
    "libasound": "LGPL-2.1", "libgfortran": "GPL-3.0 with the GCC runtime exception", "libgomp": "GPL-3.0 with the GCC runtime exception",
    "libquadmath": "LGPL-2.1", "libembree4": "Apache-2.0", "libtbb": "Apache-2.0",
}  # fmt: skip
"""Licences of shared libraries inside wheels that are not permissive, or that an extra exists for. Python metadata does not list them."""


@dataclass(frozen=True)
class Audit:
    """The answer of a vulnerability service.

    Attributes:
        vulnerable: "name version: identifiers" of each package with a known vulnerability.
        unknown: "name version" of each package that the service could not look up.
        audited: number of packages that it could.
    """

    vulnerable: tuple[str, ...]
    unknown: tuple[str, ...]
    audited: int

    @staticmethod
    def of(answer: str) -> Audit:
        """Read the JSON that pip-audit prints.

        Raises:
            ValueError: it is not that JSON.
        """
        try:
            packages = json.loads(answer)["dependencies"]
            known = [package for package in packages if "skip_reason" not in package]
            found = {
                f"{package['name']} {package['version']}": [v["id"] for v in package["vulns"]] for package in known
            }
            unknown = tuple(package["name"] for package in packages if "skip_reason" in package)
        except (ValueError, KeyError, TypeError) as error:
            raise ValueError("pip-audit printed something else than its JSON") from error
        vulnerable = tuple(f"{name}: {', '.join(ids)}" for name, ids in found.items() if ids)
        return Audit(vulnerable, unknown, len(known))

    @property
    def exit_code(self) -> int:
        """0 only if every package was looked up and none is vulnerable."""
        return VULNERABLE if self.vulnerable else NOT_AUDITED if self.unknown or not self.audited else 0

    @property
    def lines(self) -> list[str]:
        """What to print."""
        lines = [f"vulnerable: {one}" for one in self.vulnerable]
        if self.unknown:
            lines.append(f"not audited: {len(self.unknown)} packages: {', '.join(self.unknown)}")
        return [*lines, f"audited: {self.audited} packages"]


def write_pins(path: Path) -> None:
    """Write the pins of the base set and all extras with the hashes of their files.

    Raises:
        InputError: uv cannot resolve them.
    """
    extras = importlib.metadata.metadata("semgs").get_all("Provides-Extra") or []
    chosen = [f"--extra={one}" for one in extras if one != "cuda"]  # gsplat compiles for the CUDA of each machine
    done = resolved("--generate-hashes", *chosen, "--no-emit-index-url", "--no-emit-find-links", "--no-annotate")
    if done.returncode:
        raise InputError(ROOT / "constraints.txt", "versions that fit together", done.stderr.strip().splitlines()[-1])
    path.write_text(done.stdout)


def without_hashes(lock: str) -> list[str]:
    """The pins of a lock file that have no hash."""
    entries = re.split(r"\n(?=\S)", lock.strip())
    return [one.split()[0] for one in entries if not one.startswith("#") and "--hash=sha256:" not in one]


def vulnerabilities(lock: Path) -> Audit:
    """What the vulnerability service knows of the pins of a lock file.

    Raises:
        InputError: pip-audit does not run, or cannot reach the service.
    """
    command = [sys.executable, "-m", "pip_audit", "--no-deps", "--disable-pip", "--progress-spinner", "off"]
    done = subprocess.run([*command, "-r", str(lock), "-f", "json"], capture_output=True, text=True, check=False)
    try:
        return Audit.of(done.stdout)
    except ValueError as error:
        said = done.stderr.strip().splitlines() or [str(error)]
        raise InputError(lock, "an answer of the vulnerability service", said[-1]) from error


def base_set(name: str = "semgs") -> set[str]:
    """The packages that are installed without extras: the closure of the requirements, by name, semgs left out."""
    found: set[str] = set()
    todo = [name]
    while todo:
        for text in importlib.metadata.requires(todo.pop()) or []:
            required = Requirement(text)
            key = required.name.lower().replace("_", "-")
            if key not in found and (required.marker is None or required.marker.evaluate({"extra": ""})):
                found.add(key)
                todo.append(required.name)
    return found


def licence(name: str) -> str:
    """The licence of an installed package, by its metadata."""
    metadata: Any = importlib.metadata.metadata(name)
    classifiers = [text for text in metadata.get_all("Classifier") or [] if text.startswith("License ::")]
    stated = (metadata.get("License-Expression") or metadata.get("License") or "").strip().splitlines()
    return (
        metadata.get("License-Expression")
        or ", ".join(text.rpartition(" :: ")[2] for text in classifiers)
        or (stated[0] if stated else "not stated")
    )


def is_gpl(text: str) -> bool:
    """Whether a licence is the GPL without an exception for what links it, and without another licence to choose instead."""
    return bool(re.search(r"(?<!L)GPL|(?<!Lesser )General Public License", text)) and not re.search(
        r"exception|Lesser|LGPL|\bOR\b| or |, (?:BSD|MIT)|(?:BSD|MIT).*, ", text
    )


def bundled() -> Iterator[tuple[str, str, str]]:
    """(package, library, licence) of the shared libraries inside installed wheels that `BUNDLED` lists."""
    for folder in sorted(Path(sysconfig.get_paths()["purelib"]).glob("*.libs")):
        names = sorted({re.split(r"-[0-9a-f]{8}|\.so", one.name)[0] for one in folder.iterdir()})
        yield from ((folder.stem, one, BUNDLED[one]) for one in names if one in BUNDLED)


def audit_release(lock: Path) -> int:
    """Audit the installed environment and the pins, print what was found, and return the exit code."""
    write_pins(lock)
    problems = [f"no hash: {one}" for one in without_hashes(lock.read_text())]
    checked = subprocess.run([sys.executable, "-m", "pip", "check"], capture_output=True, text=True, check=False)
    problems += checked.stdout.strip().splitlines() if checked.returncode else []
    base = base_set()
    licences = {one: licence(one) for one in sorted(base)}
    problems += [f"GPL in the base set: {name}: {text}" for name, text in licences.items() if is_gpl(text)]
    inside = list(bundled())
    for name, library, text in inside:
        if name.lower().replace("_", "-") in base and is_gpl(text):
            problems.append(f"GPL in the base set: {library} inside {name}: {text}")
    found = vulnerabilities(lock)
    print("Licences of the base set", *(f"  {name}: {text}" for name, text in licences.items()), sep="\n")
    print("Libraries inside wheels", *(f"  {name}: {library}: {text}" for name, library, text in inside), sep="\n")
    print(*problems, *found.lines, sep="\n")
    return VULNERABLE if problems else found.exit_code
