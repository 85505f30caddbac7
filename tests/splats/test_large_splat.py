"""A million Gaussians render in seconds on two cores, in less than 2 GB."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.long
def test_a_million_gaussians_take_at_most_3_seconds_of_two_cores_and_2_gb():
    command = [sys.executable, str(ROOT / "scripts" / "large_splat.py")]
    environment = os.environ | {"OMP_NUM_THREADS": "2", "PYTHONPATH": str(ROOT)}
    told = subprocess.run(command, capture_output=True, text=True, check=True, env=environment, timeout=250)
    numbers = json.loads(told.stdout)
    assert numbers["gaussians"] == 1_000_000
    assert numbers["CPU seconds"] < 2 * 3
    assert numbers["peak GB"] < 2
