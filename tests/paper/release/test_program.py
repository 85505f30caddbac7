"""The program of release work: what it draws of a demo, and that bad input is one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paper.release.__main__ import main
from paper.release.demo import demo_picture
from semgs.files.images.pictures import write_png


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("card --report rooms {0}/none.json", "none.json"),
        ("ship {0}/none.safetensors small --description x", "none.safetensors"),
        ("failures nowhere.safetensors --data {0} --out {0}/a.jpg", "scene"),
        ("failures small --data {0}", "expected --data and --out together"),
        ("notice {0}/ATTRIBUTION.md --photos {0}/sources.json", "ATTRIBUTION.md"),
        ("demo {0}", "a folder that semgs demo wrote"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    line: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(line.format(tmp_path).split()) == 2
    error = capsys.readouterr().err
    assert told in error
    assert len(error.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_the_picture_of_a_demo_has_a_row_for_each_view_and_four_columns(tmp_path: Path):
    """Context rows show the photo that went in; the depth of 2 m everywhere has one colour."""
    renders = tmp_path / "renders"
    renders.mkdir()
    for stem, photo in (("context_0", "input"), ("target_0", "truth")):
        for name, value in ((photo, 200), ("image", 100), ("classes", 50)):
            write_png(renders / f"{stem}_{name}.png", np.full((24, 32, 3), value, np.uint8))
        write_png(renders / f"{stem}_depth.png", np.full((24, 32), 2000, np.uint16))
    picture = demo_picture(tmp_path)
    assert picture.shape == (2 * 180, 4 * 240, 3)
    assert [picture[90, 240 * column + 120].tolist() for column in range(3)] == [[200] * 3, [100] * 3, [50] * 3]
    assert len(np.unique(picture[:, 720:].reshape(-1, 3), axis=0)) == 1
