"""How a training is run."""

from __future__ import annotations

from pathlib import Path

import pytest

from semgs.training.loop import train
from semgs.training.run.execution import Execution, Share


def test_the_processes_of_all_machines_share_a_step():
    assert Execution(devices=2, nodes=3, accumulate=4).share(5) == Share(5, 6, 4)
    pieces = [piece for rank in range(2) for piece in Execution(devices=2, accumulate=3).share(rank).pieces(1, 12)]
    assert [k for piece in pieces for k in piece] == list(range(12, 24))


def test_a_step_that_cannot_be_shared_ends_a_training_before_it_makes_its_folder(settings, tmp_path: Path):
    with pytest.raises(ValueError, match="a step of 2 scenes cannot be shared by 3 processes"):
        train(settings, tmp_path / "run", Execution(devices=3))
    assert not (tmp_path / "run").exists()
