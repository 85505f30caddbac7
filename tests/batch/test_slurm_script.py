"""The script for SLURM with stand-ins for its commands: what it starts, where, and in which order."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "slurm_batch.sh"

STAND_INS = {
    "scontrol": "printf 'red\\ngreen\\nblue\\n'",
    "srun": 'echo "srun $*" >> "$LOG"; case "$*" in *" ray start "*) exec "$SLEEP" 600;; esac; exit 3',
    "sleep": 'echo "$1" >> "$LOG.waits"; until [ "$(wc -l < "$LOG")" -ge "$(wc -l < "$LOG.waits")" ]; do "$SLEEP" 0.01; done',
}
"""Each wait lasts until one more `srun` has begun, however long that takes."""


def test_ray_starts_on_all_machines_then_the_batch_on_the_first_and_its_exit_code_is_kept(tmp_path: Path):
    for name, text in STAND_INS.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / name).chmod(0o755)
    log = tmp_path / "log"
    log.touch()
    sleep = shutil.which("sleep")
    assert sleep is not None
    environment = {
        **os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}", "LOG": str(log), "SLEEP": sleep, "SLURM_JOB_NODELIST": "red,green,blue",
        "SLURM_CPUS_PER_TASK": "32",
    }  # fmt: skip
    done = subprocess.run(
        ["bash", SCRIPT, "reconstruct", "my scans", "--out", "out"], env=environment, timeout=250, check=False
    )
    assert done.returncode == 3
    assert (tmp_path / "log.waits").read_text().split() == ["20", "20"]
    head, others, batch = log.read_text().splitlines()
    assert head.startswith(
        "srun --nodes 1 --ntasks 1 --cpus-per-task 32 --nodelist red ray start --head --port 6379 --num-cpus 32 "
    )
    assert (
        others
        == "srun --nodes 2 --ntasks 2 --cpus-per-task 32 --exclude red ray start --address red:6379 --num-cpus 32 --block"
    )
    assert batch.endswith("--nodelist red semgs batch reconstruct my scans --out out --ray red:6379")
