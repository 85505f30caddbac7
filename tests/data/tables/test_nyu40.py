"""NYU40: each of its classes becomes one of the 20, or none."""

from __future__ import annotations

import numpy as np
import pytest
from scannet_writer import tsv

from semgs.data.layouts.scannet.scannet_labels import NYU40_NAMES, read_table, scannet20_labels
from semgs.data.tables.classes import SCANNET20

IGNORED = (
    "blinds", "shelves", "dresser", "pillow", "mirror", "floor mat", "clothes", "ceiling", "books", "television", "paper",
    "towel", "box", "whiteboard", "person", "night stand", "lamp", "bag", "otherstructure", "otherprop",
)  # fmt: skip


@pytest.mark.parametrize("number", range(41))
def test_each_of_the_40_and_0_is_mapped_or_ignored(number):
    label = scannet20_labels()[number]
    if number == 0 or NYU40_NAMES[number - 1] in IGNORED:
        assert label == 255
    else:
        assert SCANNET20.names[label] == NYU40_NAMES[number - 1]


def test_twenty_are_ignored_and_twenty_are_mapped():
    assert len(NYU40_NAMES) == len(set(NYU40_NAMES)) == 40
    assert sorted(scannet20_labels()[scannet20_labels() < 255]) == list(range(20))


def peers(raw: np.ndarray, nyu40_of: dict[int, int], gsnerf: bool) -> np.ndarray:
    """The peers' rules on ids, written out: a list of 20 valid NYU40 ids, in S-Ray 20 for all others, in GSNeRF two exchanges behind."""
    valid = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 24, 28, 33, 34, 36, 39]
    result = np.full(raw.shape, 20)
    for place, identity in np.ndenumerate(raw):
        nyu40 = nyu40_of.get(int(identity), 0)
        if nyu40 in valid:
            result[place] = valid.index(nyu40)
    if gsnerf:
        result[result == 19] = 6
        result[result == 20] = 19
    return result


@pytest.mark.parametrize("gsnerf", [False, True])
def test_both_peers_rules_are_met_on_an_example(tmp_path, gsnerf):
    (tmp_path / "table.tsv").write_bytes(tsv())
    table = read_table(tmp_path / "table.tsv")
    raw = np.array([[1, 3, 56, 41], [0, 22, 1163, 4000], [188, 42, 17, 6]], np.uint16)
    ours = table.labels(["gsnerf-labels"] if gsnerf else [])[raw].astype(int)
    assert np.where(ours == 255, 20, ours).tolist() == peers(raw, table.by_id, gsnerf).tolist()
    if gsnerf:
        assert ours.tolist() == [[0, 1, 6, 19], [19, 19, 19, 19], [19, 18, 16, 5]]
    else:
        assert ours.tolist() == [[0, 1, 19, 255], [255, 255, 255, 255], [255, 18, 16, 5]]


def test_of_rows_that_share_an_id_the_last_counts(tmp_path):
    (tmp_path / "table.tsv").write_bytes(tsv())
    table = read_table(tmp_path / "table.tsv")
    assert table.by_id[188] == 38
    assert (table.by_name["shower door"], table.by_name["shower doors"]) == (8, 38)
