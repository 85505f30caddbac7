"""`semgs export-network`."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from semgs.cli.main import main
from semgs.model.onnx import onnx_file
from semgs.model.weights.load import data_terms, shipped


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (["small", "--size", "240x330"], "the size is 240x330; expected multiples of 16, such as 240x336"),
        (["small", "--size", "240"], "expected height x width in pixels, such as 240x320, found '240'"),
        (["small", "--views", "1"], "expected a whole number, 2 or more, found '1'"),
        (["small", "--views", "17"], "--views is 17; expected 2 to 16"),
        (["base"], 'there are no included weights for "base"'),
        (["nope"], "nope: expected a file of weights, or small for the included weights, found nothing there"),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], line: str):
    assert main(["export-network", *options, "--out", str(tmp_path / "new.onnx")]) == 2
    printed = capsys.readouterr().err
    assert line in printed
    assert printed.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_exists_stays_unless_it_may_be_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    there = tmp_path / "there.onnx"
    there.write_bytes(b"mine")
    assert main(["export-network", "small", "--out", str(there)]) == 2
    assert "expected a new file, found one that exists; use --overwrite to replace it" in capsys.readouterr().err
    assert main(["export-network", "small", "--out", str(tmp_path / "none" / "new.onnx")]) == 2
    assert "expected a file in an existing folder" in capsys.readouterr().err
    assert there.read_bytes() == b"mine"


@pytest.mark.parametrize("missing", ["onnx", "onnxscript", "onnxruntime"])
def test_without_the_extra_it_says_how_to_install_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, missing: str
):
    for library in ("onnx", "onnxscript"):
        monkeypatch.setitem(sys.modules, library, None if library == missing else sys)
    if missing == "onnxruntime":
        monkeypatch.setattr(onnx_file, "find_spec", lambda name: None)
    assert main(["export-network", "small", "--out", str(tmp_path / "new.onnx")]) == 2
    printed = capsys.readouterr().err
    assert (
        "writing an ONNX file needs onnx, onnxscript and onnxruntime: pip install -e '.[onnx]' in SemGS's folder"
        in printed
    )
    assert printed.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_file_gets_the_networks_bytes_and_the_terms_of_its_data(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    given = []
    monkeypatch.setattr(onnx_file, "check_onnx_libraries", lambda: None)
    monkeypatch.setattr(onnx_file, "onnx_bytes", lambda *args, **options: given.append(args) or b"graph")
    out = tmp_path / "new.onnx"
    assert main(["export-network", str(shipped("small")), "--views", "3", "--size", "48x64", "--out", str(out)]) == 0
    assert out.read_bytes() == b"graph"
    ((network, views, size, metadata),) = given
    assert (network.name, network.training, views, size) == ("small", False, 3, (48, 64))
    assert metadata["data_terms"] == "\n".join(one.text for one in data_terms("small"))
    assert f"{out}: small for 3 views of 48x64" in capsys.readouterr().out
    assert [path.name for path in tmp_path.iterdir()] == ["new.onnx"]
