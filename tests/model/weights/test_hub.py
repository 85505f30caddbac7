"""Weights on the hub, with a hub that is made up: no test fetches anything."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from semgs import load
from semgs.cli.main import main
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.model.weights.hub import HubId, is_hub_id
from semgs.model.weights.initial_weights import initial_network
from semgs.model.weights.load import find, shipped

ASKED = "hf://owner/rooms"
COMMIT = "c0ffee" + 34 * "0"


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Callable[..., list[Any]]:
    """Puts a hub in place of huggingface_hub that has what ships; what it was asked is listed. Its repository can be changed."""

    def put(**change: Any) -> list[Any]:
        asked: list[Any] = []
        content = change.get("content", shipped("small").read_bytes())
        (tmp_path / "cached.safetensors").write_bytes(content)
        file = SimpleNamespace(rfilename="w.safetensors", lfs=SimpleNamespace(sha256=sha256(shipped("small"))))
        readme = SimpleNamespace(rfilename="README.md", lfs=None)
        repository = SimpleNamespace(sha=COMMIT, siblings=change.get("siblings", lambda one: [readme, one])(file))

        class Api:
            def model_info(self, name: str, *, revision: str | None, files_metadata: bool) -> Any:
                asked.append((name, revision, files_metadata))
                if "unreachable" in change:
                    raise change["unreachable"]
                return repository

        def download(name: str, file: str, *, revision: str) -> str:
            asked.append((name, file, revision))
            if "cut" in change:
                raise change["cut"]
            return str(tmp_path / "cached.safetensors")

        monkeypatch.setitem(sys.modules, "huggingface_hub", SimpleNamespace(HfApi=Api, hf_hub_download=download))
        return asked

    return put


def test_a_hub_id_loads_as_a_file_does(hub: Callable[..., list[Any]], tmp_path: Path):
    asked = hub()
    model, same = load(f"{ASKED}@v1.0"), load("small")
    assert all(torch.equal(one, same.state_dict()[name]) for name, one in model.state_dict().items())
    assert asked == [("owner/rooms", "v1.0", True), ("owner/rooms", "w.safetensors", COMMIT)]
    assert find(ASKED) == ("small", tmp_path / "cached.safetensors")
    assert load("small", ASKED).origin.startswith("cached.safetensors: ")
    assert initial_network("small", ASKED).origin == f"cached.safetensors: all {len(same.state_dict())} tensors kept"


def test_a_file_loads_by_its_path_alone(tmp_path: Path):
    assert load(shipped("small")).name == "small"
    with pytest.raises(ValueError, match="unknown model 'owner/rooms'"):
        load("owner/rooms")


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("hf://a/b", HubId("a/b")),
        ("hf://a/b.c-d@refs/pr/3", HubId("a/b.c-d", "refs/pr/3")),
        (f"hf://a/b@sha256:{'0f' * 32}", HubId("a/b", None, "0f" * 32)),
        (f"hf://a/b@main@sha256:{'0f' * 32}", HubId("a/b", "main", "0f" * 32)),
    ],
)
def test_ids_have_a_repository_a_revision_and_a_hash(text: str, found: HubId):
    assert is_hub_id(text)
    assert HubId.parsed(text) == found


@pytest.mark.parametrize("text", ["hf://", "hf://a", "hf://a/b/c", "hf://a/b@", "hf://a/b@sha256:0f", "hf://../b", "hf://a/b@x y"])  # fmt: skip
def test_other_texts_are_refused(text: str):
    with pytest.raises(InputError, match="expected hf://OWNER/NAME"):
        HubId.parsed(text)


@pytest.mark.parametrize("path", ["owner/name", "runs/a@b.safetensors", "./hf:/a/b", Path("hf://a/b")])
def test_a_path_is_no_id(path: str | Path):
    assert not is_hub_id(path)


def lost(file: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(rfilename=file.rfilename, lfs=None)


@pytest.mark.parametrize(
    ("change", "asked", "told"),
    [
        ({"unreachable": OSError("no route\nto host")}, ASKED, "rooms: expected a repository on the hub, found no route; download"),
        ({"cut": RuntimeError()}, ASKED, "found RuntimeError; download the file by other means"),
        ({"content": b"other"}, ASKED, "cached.safetensors: expected sha256 .*, as of hf://owner/rooms, found"),
        ({}, f"{ASKED}@sha256:{'0' * 64}", "found .*, as the repository states"),
        ({"siblings": lambda file: [file, file]}, ASKED, "with one safetensors file, found w.safetensors, w.safetensors"),
        ({"siblings": lambda file: []}, ASKED, "with one safetensors file, found none"),
        ({"siblings": lambda file: [lost(file)]}, ASKED, "whose sha256 the repository states, found one outside LFS; give it"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_on_one_line(hub: Callable[..., list[Any]], capsys, change: dict, asked: str, told: str):
    hub(**change)
    with pytest.raises(InputError, match=told):
        find(asked)
    assert main(["weights", asked]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_hash_that_is_given_stands_in_for_one_that_is_not_stated(hub: Callable[..., list[Any]]):
    hub(siblings=lambda file: [lost(file)])
    assert load(f"{ASKED}@sha256:{sha256(shipped('small'))}").name == "small"


def test_without_the_library_the_extra_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    assert main(["weights", ASKED]) == 2
    assert "pip install -e '.[hub]' in SemGS's folder" in capsys.readouterr().err
