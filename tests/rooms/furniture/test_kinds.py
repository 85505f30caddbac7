"""The stream of pieces: the same whatever else is made, in fair shares, and nothing of what is held out."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from semgs_rooms.assets.catalogue import read_catalogue, usable
from semgs_rooms.assets.splits import family, split_meshes
from semgs_rooms.furniture.kinds import KINDS, OBJECTS, make_job

REAL = Path(__file__).parents[3].parent / "shared" / "assets"
ROUND = sum(kind.share for kind in KINDS.values())


def test_kinds_come_in_fair_shares_and_early():
    for seed in (0, 7):
        kinds = [make_job(seed, number).kind for number in range(2 * ROUND)]
        for start in (0, ROUND):
            assert Counter(kinds[start : start + ROUND]) == {name: kind.share for name, kind in KINDS.items()}
    labels = {KINDS[make_job(0, number).kind].label for number in range(ROUND // 2)}
    assert len(labels) >= 10


def test_pieces_of_a_seed_are_its_own():
    jobs = [make_job(seed, number) for seed in (0, 1) for number in range(60)]
    assert len({job.makes[0].seed for job in jobs}) == len(jobs)
    assert len({job.name for job in jobs}) == len(jobs)
    assert make_job(1, 9) == make_job(1, 9)
    assert make_job(1, 9).random().random() == make_job(1, 9).random().random()


def test_sizes_are_possible():
    for kind in KINDS.values():
        assert all(0 < low < high for low, high in zip(kind.low, kind.high, strict=True))
        assert max(kind.low) <= kind.largest


@pytest.mark.skipif(not REAL.is_dir(), reason="the folder of assets is not here")
def test_nothing_is_generated_that_the_lists_hold_out():
    rows = [row for row in read_catalogue(REAL).meshes if usable(row)]
    lists = split_meshes(rows)
    held_out = {
        (row.origin.path, row.subtype)
        for row in rows
        if lists[row.name] == "other" and row.origin.source == "princeton-vl/infinigen"
    }
    assert {family(row) for row in rows if (row.origin.path, row.subtype) in held_out} == {
        "ig_dresser", "ig_shower_curtain", "ig_vanity",
    }  # fmt: skip
    for job in (make_job(seed, number) for seed in range(8) for number in range(ROUND)):
        path = f"{OBJECTS}/{job.makes[0].factory.rsplit('.', 1)[0].replace('.', '/')}.py"
        assert (path, KINDS[job.kind].subtype) not in held_out
