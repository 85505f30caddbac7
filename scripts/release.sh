#!/bin/sh
# Build wheel and sdist of semgs and semgs-rooms into dist/, ready for a package index, and check them. Then install the wheels into an empty environment away from the repository,
# run the demo there, print what an install costs, and generate a room.
#
#     make release
#
# Uploads nothing.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
python=$root/.venv/bin/python
rm -rf "$root/dist"
for project in "$root" "$root/packages/semgs-rooms"; do "$python" -m build --no-isolation --outdir "$root/dist" "$project"; done # the wheel is built from the sdist
"$python" -m twine check --strict "$root"/dist/*
away=$(mktemp -d)
trap 'rm -rf "$away"' EXIT
"$python" -m venv "$away/venv"
"$away/venv/bin/python" -m pip install --quiet --disable-pip-version-check -c "$root/constraints.txt" "$root"/dist/semgs-*.whl
cd "$away"
"$away/venv/bin/semgs" demo --out demo
[ -s demo/report.html ] && [ -s demo/gaussians.ply ]
"$away/venv/bin/python" -c 'import semgs; print(*(getattr(semgs, name) for name in semgs.__all__), sep="\n")' > public_names
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
"$away/venv/bin/python" -m pip install --quiet --disable-pip-version-check -c "$root/constraints.txt" "$root"/dist/semgs_rooms-*.whl
"$away/venv/bin/semgs" rooms --out rooms --scenes 1 --frames 2 --size 48x64 --workers 0
ls -l "$root/dist"
