"""Where the base set can be installed without a compiler: every package has a wheel for the platform, at the version of constraints.txt.

    python -m paper.release platforms

Needs uv and a package index. Only Linux on x86-64 is tested; this says that the others are not ruled out by a dependency.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from paper.release.pins import resolved

PYTHONS = ("3.11", "3.12", "3.13")


@dataclass(frozen=True)
class Platform:
    """A platform.

    Attributes:
        name: for people.
        target: as uv calls it.
        expected: whether it has to have all wheels. Intel Macs do not: torch and numba have none for them any more.
    """

    name: str
    target: str
    expected: bool = True


PLATFORMS = (
    Platform("Linux x86-64", "x86_64-manylinux_2_28"),
    Platform("Linux aarch64", "aarch64-manylinux_2_28"),
    Platform("macOS 14, Apple silicon", "aarch64-apple-darwin"),
    Platform("macOS 14, Intel", "x86_64-apple-darwin", expected=False),
    Platform("Windows x86-64", "x86_64-pc-windows-msvc"),
)


def missing(platform: Platform, python: str) -> str | None:
    """Which package has no wheel there, in uv's words; None if none is missing."""
    done = resolved("--python-platform", platform.target, "--python-version", python, "--only-binary", ":all:")
    return None if done.returncode == 0 else reason(done.stderr)


def reason(said: str) -> str:
    """The package that uv names as having no wheel, or all that it said."""
    words = " ".join(said.split())
    found = re.search(r"([\w.-]+==[\w.]+) has no (?:usable )?wheels", words)
    return f"{found[1]} has no wheel" if found else words


def check_platforms() -> int:
    """Print a table of platforms and versions of Python; 1 if a wheel is missing that has to be there."""
    failed = False
    print("| platform |", *(f"Python {one} |" for one in PYTHONS))
    print("|---|" + "---|" * len(PYTHONS))
    for platform in PLATFORMS:
        found = [missing(platform, python) for python in PYTHONS]
        failed |= platform.expected and any(found)
        print(f"| {platform.name} |", *(f"{one or 'yes'} |" for one in found))
    return int(failed)
