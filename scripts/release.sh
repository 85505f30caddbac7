#!/bin/sh
# Build wheel and sdist into dist/, install the wheel into an empty environment away from the repository, run the demo there, print what an install costs, and generate a room with that of semgs-rooms.
#
#     make release
#
# Uploads nothing.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
rm -rf "$root/dist"
"$root/.venv/bin/python" -m hatchling build -t wheel -t sdist -d "$root/dist"
(cd "$root/packages/semgs-rooms" && "$root/.venv/bin/python" -m hatchling build -t wheel -d "$root/dist/rooms")
away=$(mktemp -d)
trap 'rm -rf "$away"' EXIT
"$root/.venv/bin/python" -m venv "$away/venv"
"$away/venv/bin/python" -m pip install --quiet --disable-pip-version-check -c "$root/constraints.txt" "$root"/dist/*.whl
cd "$away"
"$away/venv/bin/semgs" demo --out demo
[ -s demo/report.html ] && [ -s demo/gaussians.ply ]
"$away/venv/bin/python" - <<'EOF'
import importlib.metadata as metadata
import subprocess
import sys
from pathlib import Path
from time import perf_counter

from packaging.requirements import Requirement


def closure(name):
    """The packages that a package requires, without extras, by their names in lower case."""
    found, todo = set(), [name]
    while todo:
        for text in metadata.requires(todo.pop()) or []:
            required = Requirement(text)
            key = required.name.lower().replace("_", "-")
            if key not in found and (required.marker is None or required.marker.evaluate({"extra": ""})):
                found.add(key)
                todo.append(key)
    return found


def megabytes(names):
    """The size of installed packages on disk [MB]."""
    files = (file.locate() for name in names for file in metadata.files(name) or [])
    return sum(Path(file).stat().st_size for file in files if Path(file).exists()) / 1e6


def seconds(*code):
    """The shortest of five starts of Python [s]."""
    times = []
    for _ in range(5):
        start = perf_counter()
        subprocess.run([sys.executable, *code], check=True, capture_output=True)
        times.append(perf_counter() - start)
    return min(times)


base, torchs = closure("semgs"), closure("torch") | {"torch"}
print(f"packages, without torch's      {len(base - torchs)}")
print(f"on disk, without torch's       {megabytes(base - torchs):.0f} MB")
print(f"on disk, semgs itself          {megabytes({'semgs'}):.1f} MB")
print(f"semgs --help                   {seconds('-m', 'semgs', '--help'):.2f} s")
print(f"import semgs, then semgs.load  {seconds('-c', 'import semgs; semgs.load'):.2f} s")
EOF
"$away/venv/bin/python" -m pip install --quiet --disable-pip-version-check -c "$root/constraints.txt" "$root"/dist/rooms/*.whl
"$away/venv/bin/semgs" rooms --out rooms --scenes 1 --frames 2 --size 48x64 --workers 0
ls -l "$root/dist" "$root/dist/rooms"
