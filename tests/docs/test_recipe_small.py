"""The script of the included weights holds together: every command of it is complete, and starts from what an earlier one has made."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "scripts" / "recipe_small.sh"
RUNS = 47
"""Runs that the script and docs/train.md name."""

STAND_IN = '''#!{python} -SE
"""Stands in for semgs, for Python and for gpu_day.sh: notes the call, checks that what it reads is there, makes what it would write."""
import sys
from pathlib import Path

name, given = Path(sys.argv[0]).name, sys.argv[1:]
made, read, runs = [], [], []


def after(option):
    values = []
    for value in given[given.index(option) + 1 :] if option in given else ():
        if value.startswith("--"):
            break
        values.append(value)
    return values


if name == "semgs" and given[0] == "rooms":
    made += after("--out")
    assert [int(after(one)[0]) > 0 for one in ("--scenes", "--frames", "--seed")] == [True] * 3, given
    assert after("--size")[0] in ("120x160", "240x320"), given
    read += [one for index, one in enumerate(given) if given[index - 1] == "--assets"]
elif name == "semgs":
    assert given[:2] == ["train", "small"], given
    runs.append(after("--out")[0])
    assert int(after("--steps")[0]) > 0 and int(after("--seed")[0]) > 0, given
    read += [one.partition("=")[0] for one in after("--data")] + after("--teacher") + after("--scenes")
    read += [one for one in after("--init") + after("--validation") if one != "small"]
elif name == "gpu_day.sh":
    runs += [given[0] + "/classes", given[0] + "/depth", given[0] + "/colour"]
    read += given[1:]
elif given[0] == "-":
    made += [given[1]] if len(given) == 3 and given[1].endswith("held") else [given[2] + "/kept_back", given[2] + "/learned"]
elif given[0] == "-m":
    made += after("--out")
elif given[0].endswith("teach.py"):
    made.append(given[2])
    read += [given[1], *given[3:]]
elif given[0].endswith("undo_class_weights.py"):
    read += given[1:3]
    made.append(given[3])
else:
    assert given[0].endswith("average_weights.py"), given
    start, *rest = given[2:] if given[1] == "--start" else ("small", *given[1:])
    read += rest[1:] if start == "small" else [start, *rest[1:]]
    made.append(rest[0])
missing = [one for one in read if not Path(one).exists()]
assert not missing, (given, missing)
for one in made:
    path = Path(one)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch() if path.suffix else path.mkdir(parents=True, exist_ok=True)
for run in map(Path, runs):
    run.mkdir(parents=True)
    (run / "weights.safetensors").touch()
    (run / "log.jsonl").write_text('{{"validation": 1}}\\n')
    with open("{log}", "a") as log:
        print(run.name, file=log)
'''


def test_every_run_starts_from_what_was_made_before(tmp_path: Path) -> None:
    names = tmp_path / "runs.txt"
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin/semgs").write_text(STAND_IN.format(python=sys.executable, log=names))
    (tmp_path / "bin/semgs").chmod(0o755)
    for copy in ("bin/python", "gpu_day.sh"):
        shutil.copy(tmp_path / "bin/semgs", tmp_path / copy)
    shutil.copy(SCRIPT, tmp_path)
    for given in ("assets", "photos_given"):
        (tmp_path / given).mkdir()
    (tmp_path / "teacher.tflite").touch()
    command = ("bash", "recipe_small.sh", "work", "assets", "random", "teacher.tflite", "photos_given")
    done = subprocess.run(
        command, cwd=tmp_path, env={"PATH": f"{tmp_path}/bin:/usr/bin:/bin"}, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert len(names.read_text().splitlines()) == RUNS
    assert f"{_word(RUNS)} runs" in SCRIPT.read_text()
    assert f"{_word(RUNS)} runs" in (SCRIPT.parents[1] / "docs/train.md").read_text()


def _word(number: int) -> str:
    """A number from 30 to 49 as the texts have it."""
    digits = ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine"]
    tens = {3: "thirty", 4: "forty"}[number // 10]
    return f"{tens}-{digits[number % 10 - 1]}" if number % 10 else tens
