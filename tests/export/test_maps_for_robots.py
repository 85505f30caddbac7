from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.export.map_files import map_image, save_map, save_voxels
from semgs.robotics.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy

CELLS = np.array(
    [[FREE, FREE, OCCUPIED, UNKNOWN], [FREE, UNKNOWN, OCCUPIED, UNKNOWN], [OCCUPIED, OCCUPIED, OCCUPIED, FREE]], np.int8
)


def some_occupancy(cells: np.ndarray = CELLS) -> Occupancy:
    """A plan with two layers of voxels."""
    voxels = np.stack((cells, np.full_like(cells, UNKNOWN)))
    labels = np.where(voxels == OCCUPIED, 4, IGNORE).astype(np.uint8)
    return Occupancy(cells, voxels, labels, (-1.25, 2.5, -0.1), 0.05, 0.02, np.eye(3))


def as_map_server_reads(folder: Path) -> tuple[np.ndarray, dict[str, str]]:
    """map_server's published rule for mode trinary, on the two files: cells as in nav_msgs/OccupancyGrid, the first row at the origin."""
    settings = dict(line.split(": ", 1) for line in (folder / "map.yaml").read_text().splitlines())
    assert (settings["mode"], settings["negate"]) == ("trinary", "0")
    image = np.asarray(Image.open(folder / settings["image"]))
    occupied, free = float(settings["occupied_thresh"]), float(settings["free_thresh"])
    shade = (255 - image.astype(np.float64)) / 255
    return np.where(shade > occupied, 100, np.where(shade < free, 0, -1))[::-1], settings


def test_a_map_of_3x4_cells_has_these_bytes() -> None:
    rows = ((0, 0, 0, 254), (254, 205, 0, 205), (254, 254, 0, 205))  # the row with the largest y is the first
    assert map_image(CELLS) == b"P5\n4 3\n255\n" + bytes(np.array(rows, np.uint8).tobytes())


def test_map_server_gets_our_grid_back_cell_for_cell(tmp_path: Path) -> None:
    cells = np.random.default_rng(5).choice(np.array([FREE, OCCUPIED, UNKNOWN], np.int8), (31, 44))
    save_map(tmp_path, some_occupancy(cells))
    read, settings = as_map_server_reads(tmp_path)
    np.testing.assert_array_equal(read, cells)
    assert float(settings["resolution"]) == 0.05
    origin = [float(number) for number in re.fullmatch(r"\[(.+), (.+), (.+)\]", settings["origin"]).groups()]
    assert origin == [-1.25, 2.5, 0.0]


def test_with_a_free_thresh_of_a_quarter_unknown_would_be_free(tmp_path: Path) -> None:
    save_map(tmp_path, some_occupancy())
    file = tmp_path / "map.yaml"
    file.write_text(file.read_text().replace("free_thresh: 0.196", "free_thresh: 0.25"))
    assert ((as_map_server_reads(tmp_path)[0] == 0) == (CELLS != OCCUPIED)).all()


def test_the_settings_are_yaml_for_a_parser_that_is_not_ours(tmp_path: Path) -> None:
    yaml = pytest.importorskip("yaml")
    save_map(tmp_path, some_occupancy())
    assert yaml.safe_load((tmp_path / "map.yaml").read_text()) == {
        "image": "map.pgm",
        "mode": "trinary",
        "resolution": 0.05,
        "origin": [-1.25, 2.5, 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }


def test_voxels_come_back_with_their_classes_and_without_unpickling(tmp_path: Path) -> None:
    found = some_occupancy()
    save_voxels(tmp_path, found, SCANNET20)
    with np.load(tmp_path / "voxels.npz", allow_pickle=False) as read:
        np.testing.assert_array_equal(read["voxels"], found.voxels)
        np.testing.assert_array_equal(read["labels"], found.labels)
        assert read["classes"][read["labels"][0, 0, 2]] == "chair"
        assert read["origin"].tolist() == [-1.25, 2.5, -0.1]
        assert (float(read["resolution"]), float(read["floor"])) == (0.05, 0.02)
    save_voxels(tmp_path, replace(found, labels=np.full_like(found.labels, IGNORE)), None)
    assert np.load(tmp_path / "voxels.npz")["classes"].shape == (0,)
