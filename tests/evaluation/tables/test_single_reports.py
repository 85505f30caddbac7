"""Reports of single images: what is read of them, and how `semgs compare` shows them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from semgs.cli.main import main
from semgs.data.tables.classes import ClassTable
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.single_images import single_numbers
from semgs.evaluation.tables.comparison_tables import difference_grids, single_grid
from semgs.evaluation.tables.evaluation_report import EvaluatedMethod
from semgs.evaluation.tables.saved_report import read_report
from semgs.evaluation.tables.table_grid import printed
from semgs.files.errors import InputError

TABLE = ClassTable("two", ("wall", "floor"), ((0, 0, 0), (255, 255, 255)), (1, 2))
SCORES = sorted((Path(__file__).resolve().parents[3] / "docs/scores").glob("*.json"))


def report(folder: Path, name: str, *confusions: list[list[int]]) -> Path:
    """A report of images with these confusion matrices."""
    frames = [
        FrameScores(f"photos/{number}", str(number), (str(number),), confusion=np.array(one), truth=np.sum(one, 1))
        for number, one in enumerate(confusions)
    ]
    folder.mkdir()
    numbers = single_numbers(EvaluatedMethod(name, "weights", "here", "ab" * 32), (), frames, TABLE)
    (folder / "report.json").write_text(json.dumps({**numbers, "data": [{"name": "photos"}]}))
    return folder


@pytest.fixture
def two(tmp_path: Path) -> list[str]:
    """Six images of eight pixels: one with a wrong pixel in each, and one that is right.

    Accuracy 7 / 8 and 1; IoU of walls 3 / 4 and of floor 4 / 5, so mIoU .775, and 1.
    """
    before = report(tmp_path / "before", "before", *[[[3, 1], [0, 4]]] * 6)
    return [str(before), str(report(tmp_path / "after", "after", *[[[4, 0], [0, 4]]] * 6))]


def test_a_table_has_the_scores_of_each_with_intervals(two: list[str]):
    told = printed(single_grid([read_report(path) for path in two]), "text").splitlines()
    assert told[0] == "6 single images"
    assert told[2].split()[:5] == ["method", "mIoU", "mIoU/image", "acc.", "class"]
    assert told[4].startswith("before abababab  0.775 [0.775, 0.775]")
    assert "0.875 [0.875, 0.875]" in told[4]
    assert told[5].startswith("after abababab   1.000 [1.000, 1.000]")
    assert "intervals over scenes; images without cameras count as a scene each" in told[7]


def test_differences_are_paired(two: list[str]):
    (grid,) = difference_grids([read_report(path) for path in two])
    rows = {row[0].text: [cell.text for cell in row[2:]] for row in grid.rows}
    assert grid.title == "after abababab minus before abababab, 6 single images"
    assert rows["mIoU"] == ["0.775", "1.000", "+0.225", "+0.225 to +0.225"]
    assert rows["acc."] == ["0.875", "1.000", "+0.125", "+0.125 to +0.125"]
    assert "PSNR" not in rows


@pytest.mark.parametrize("layout", ["paper", "difference"])
def test_other_images_are_refused(two: list[str], tmp_path: Path, layout: str, capsys: pytest.CaptureFixture[str]):
    other = report(tmp_path / "other", "other", *[[[3, 1], [0, 4]]] * 5, [[4, 1], [0, 3]])
    assert main(["compare", two[0], str(other), "--layout", layout]) == 2
    assert "found other true labels" in capsys.readouterr().err


def test_single_images_and_rendered_views_are_two_things(two: list[str], capsys: pytest.CaptureFixture[str]):
    assert main(["compare", two[0], str(SCORES[0])]) == 2
    assert "expected a report of single images, as " in capsys.readouterr().err
    assert main(["compare", two[0], str(SCORES[0]), "--layout", "data"]) == 0
    told = capsys.readouterr().out
    assert any(
        line.split()[:6] == ["before", "abababab", "on", "photos", "(6", "images)"] for line in told.splitlines()
    )
    assert told.count("oracle: nearest input view's true labels") == 1
    for option in (["--layout", "card"], ["--published", "scannet"]):
        assert main(["compare", *two, *option]) == 2
        assert f"{' '.join(option[: 2 if 'card' in option else 1])} is for rendered views; " in capsys.readouterr().err


def test_an_incomplete_report_is_refused(two: list[str]):
    path = Path(two[0]) / "report.json"
    content = json.loads(path.read_text())
    for name in ("per_image", "per_class", "classes", "method", "data"):
        path.write_text(json.dumps({key: value for key, value in content.items() if key != name}))
        with pytest.raises(InputError, match="a complete report of semgs evaluate"):
            read_report(path)
    for found in (["semgs.report.single"], {}, "semgs.report.other", None):
        path.write_text(json.dumps({**content, "format": found}))
        with pytest.raises(InputError, match="a report of format"):
            read_report(path)
