"""The index of what ships, and the scores that a header tells."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from networks import preset
from safetensors.torch import load_file

from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.model.weights.header import SCORES as KEY
from semgs.model.weights.header import Figure, Score, scores_text
from semgs.model.weights.index import FILE_NAME, check, matching, read_index, shipped_folder, write_index
from semgs.model.weights.weights_file import count_parameters, read_header, read_scores, restate, save

SCORE = Score("rooms", "neighbours", 2, 96, "ab" * 32, {"miou": Figure(0.5, 0.4, 0.6), "psnr": Figure(25.0)})


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of two weights with its index; their bytes are of no interest here."""
    for name in ("b", "a"):
        (tmp_path / f"{name}.safetensors").write_bytes(name.encode() * 9)
    write_index(tmp_path)
    return tmp_path


def test_the_index_of_the_package_names_every_file_that_ships_as_it_is():
    index = read_index()
    assert {one.path for one in index} == set(shipped_folder().glob("*.safetensors"))
    for one in index:
        check(one)
        assert one.bytes == one.path.stat().st_size


def test_a_byte_that_changes_is_noticed(folder: Path):
    first, second = read_index(folder)
    assert (first.name, first.bytes, second.name) == ("a", 9, "b")
    first.path.write_bytes(b"aaaaaaaab")
    with pytest.raises(InputError, match=f"a.safetensors: expected sha256 {first.sha256[:12]} .* was changed"):
        check(first)
    check(second)
    second.path.unlink()
    with pytest.raises(InputError, match="no such file"):
        check(second)


def test_a_file_is_known_by_its_bytes_whatever_it_is_called(folder: Path):
    (folder / "downloaded").write_bytes(b"b" * 9)
    assert matching(folder / "downloaded", read_index(folder)).name == "b"
    with pytest.raises(InputError, match=r"expected the sha256 of included weights .a .*, b .*, found"):
        matching(folder / FILE_NAME, read_index(folder))
    with pytest.raises(InputError, match="a weights file, or a or b, found nothing"):
        matching(folder / "absent", read_index(folder))


@pytest.mark.parametrize("text", ["", "[]", '{"a": {}}', '{"a": {"file": "a", "sha256": "", "bytes": "many"}}'])
def test_a_broken_index_is_told_of(folder: Path, text: str):
    (folder / FILE_NAME).write_text(text)
    with pytest.raises(InputError, match="the index of the included weights"):
        read_index(folder)


def test_a_header_tells_its_scores_as_they_were_put_there(tmp_path: Path):
    path = tmp_path / "scored.safetensors"
    model = preset("small_plain", class_backbone=True)
    save(path, model, {KEY: scores_text([SCORE])})
    assert read_scores(path) == (SCORE,)
    assert count_parameters(path) == sum(parameter.numel() for parameter in model.parameters())
    save(path, model, {})
    assert read_scores(path) == ()


@pytest.mark.parametrize("scores", ["{", "[1]", '[{"data": "rooms"}]', json.dumps([{"figures": {"miou": 0.5}}])])
def test_scores_of_another_form_are_refused(tmp_path: Path, scores: str):
    path = tmp_path / "scored.safetensors"
    save(path, preset("small_plain"), {KEY: scores})
    with pytest.raises(InputError, match="scores: expected scores as JSON"):
        read_scores(path)


def test_the_hash_of_the_index_is_that_of_the_file(folder: Path):
    assert [one.sha256 for one in read_index(folder)] == [sha256(one.path) for one in read_index(folder)]


def test_restating_changes_the_header_alone(tmp_path: Path):
    path, model = tmp_path / "a.safetensors", preset("small_plain")
    save(path, model, {"seed": "3", "licence": "none"})
    restate(path, tmp_path / "b.safetensors", {"licence": "Apache-2.0"})
    assert read_header(tmp_path / "b.safetensors").metadata == {"seed": "3", "licence": "Apache-2.0"}
    first, second = load_file(path), load_file(tmp_path / "b.safetensors")
    assert {name: one.dtype for name, one in first.items()} == {name: one.dtype for name, one in second.items()}
    assert all(torch.equal(one, second[name]) for name, one in first.items())
    with pytest.raises(ValueError, match="'settings'"):
        restate(path, path, {"settings": "{}"})
