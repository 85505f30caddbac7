"""Networks to the hub and back, with a hub that is made up: no test uploads or fetches anything."""

from __future__ import annotations

import json
import shutil
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from safetensors import safe_open

import semgs
from semgs import SemGS, load
from semgs.data.origin.terms import TermsWarning
from semgs.data.views import Views
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.geometry.cameras import Cameras
from semgs.model.weights.load import shipped
from semgs.model.weights.model_page import page
from semgs.model.weights.weights_file import read_header, save

COMMIT = "c0ffee" + 34 * "0"


@pytest.fixture
def hub(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> SimpleNamespace:
    """A hub of one repository in a folder, in place of huggingface_hub; `asked` lists the calls."""
    folder, asked = tmp_path / "hub", []
    state = SimpleNamespace(folder=folder, asked=asked, error=None)

    class Api:
        def __init__(self, token: str | None = None) -> None:
            self.token = token

        def create_repo(self, **given: Any) -> Any:
            asked.append(("create", self.token, given))
            return SimpleNamespace(repo_id=given["repo_id"])

        def upload_folder(self, *, folder_path: Path, **given: Any) -> str:
            asked.append(("upload", given))
            if state.error:
                raise state.error
            shutil.copytree(folder_path, folder)
            return f"https://hub/{given['repo_id']}/commit/{COMMIT}"

        def model_info(self, name: str, *, revision: str | None, files_metadata: bool) -> Any:
            asked.append(("info", self.token, name, revision))
            files = [
                SimpleNamespace(rfilename=path.name, lfs=SimpleNamespace(sha256=sha256(path)) if path.suffix != ".md" else None)
                for path in sorted(folder.iterdir())
            ]  # fmt: skip
            return SimpleNamespace(sha=COMMIT, siblings=files)

    def download(name: str, file: str, **given: Any) -> str:
        asked.append(("download", name, file, given))
        return str(folder / file)

    def snapshot(name: str, **given: Any) -> str:
        asked.append(("snapshot", name, given))
        if not folder.exists():
            raise OSError("not in the cache")
        return str(folder)

    library = SimpleNamespace(HfApi=Api, hf_hub_download=download, snapshot_download=snapshot)
    monkeypatch.setitem(sys.modules, "huggingface_hub", library)
    return state


def some_views() -> Views:
    """Two views of noise."""
    draw = torch.Generator().manual_seed(4)
    poses = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    poses[1, 0, 3] = 0.1
    k = torch.tensor([[40.0, 0, 24.5], [0, 41.0, 15.5], [0, 0, 1]]).repeat(2, 1, 1)
    bounds = torch.tensor([[0.5, 8.0]], dtype=torch.float64).repeat(2, 1)
    return Views(torch.rand(2, 3, 32, 48, generator=draw), Cameras(poses, k, (32, 48)), bounds)


def same(one: torch.nn.Module, other: torch.nn.Module) -> bool:
    theirs = other.state_dict()
    return one.state_dict().keys() == theirs.keys() and all(
        torch.equal(value, theirs[name]) for name, value in one.state_dict().items()
    )


@pytest.mark.parametrize(("weights", "dtype"), [(None, torch.bfloat16), ("random", torch.float32)])
def test_a_network_comes_back_from_a_folder_to_the_bit(tmp_path: Path, weights: str | None, dtype: torch.dtype):
    model = load("small", weights)
    assert model.save_pretrained(tmp_path / "a" / "rooms") is None
    assert {path.name for path in (tmp_path / "a" / "rooms").iterdir()} == {"model.safetensors", "README.md"}
    back = SemGS.from_pretrained(tmp_path / "a" / "rooms")
    assert isinstance(back, SemGS)
    assert same(model, back)
    assert not back.training
    assert not any(one.requires_grad for one in back.parameters())
    assert (back.name, back.classes, back.temperatures) == (model.name, model.classes, model.temperatures)
    with safe_open(tmp_path / "a" / "rooms" / "model.safetensors", "pt") as file:
        assert {file.get_tensor(name).dtype for name in file.keys() if "weight" in name} == {dtype}  # noqa: SIM118
    views = some_views()
    one, other = model(views).gaussians, back(views).gaussians
    assert torch.equal(one.means, other.means)
    assert torch.equal(one.semantic.features, other.semantic.features)


def test_provenance_is_kept_and_given_values_replace_it(tmp_path: Path):
    before = read_header(shipped("small")).metadata
    load("small").save_pretrained(tmp_path, metadata={"licence": "MIT"})
    after = read_header(tmp_path / "model.safetensors").metadata
    assert after == before | {"licence": "MIT"}
    assert load(tmp_path / "model.safetensors").metadata["licence"] == "MIT"


def test_changed_weights_keep_no_scores_and_say_so(tmp_path: Path):
    model = load("small")
    with torch.no_grad():
        next(model.parameters()).mul_(2)
    model.save_pretrained(tmp_path)
    header = read_header(tmp_path / "model.safetensors").metadata
    assert "scores" not in header
    assert header["description"].startswith("changed after loading; before: version ")
    assert header["data_terms"] == read_header(shipped("small")).metadata["data_terms"]
    assert "No scores are stated." in (tmp_path / "README.md").read_text()


def test_what_is_uploaded_is_read_by_every_name(hub: SimpleNamespace):
    model = load("small")
    url = model.push_to_hub("owner/rooms", private=True, token="secret", branch="next", commit_message="Better")
    assert url == f"https://hub/owner/rooms/commit/{COMMIT}"
    assert hub.asked == [
        ("create", "secret", {"repo_id": "owner/rooms", "private": True, "exist_ok": True}),
        ("upload", {"repo_id": "owner/rooms", "repo_type": "model", "commit_message": "Better", "revision": "next", "create_pr": None}),
    ]  # fmt: skip
    assert {path.name for path in hub.folder.iterdir()} == {"model.safetensors", "README.md"}
    for back in (
        SemGS.from_pretrained("owner/rooms"),
        SemGS.from_pretrained("hf://owner/rooms"),
        load("hf://owner/rooms"),
        load("small", "hf://owner/rooms"),
    ):
        assert same(model, back)


def test_options_of_a_download_reach_the_library(hub: SimpleNamespace, tmp_path: Path):
    load("small").save_pretrained(hub.folder)
    SemGS.from_pretrained("owner/rooms", revision="v2", cache_dir=tmp_path, token="secret", force_download=True)
    assert hub.asked == [
        ("info", "secret", "owner/rooms", "v2"),
        ("download", "owner/rooms", "model.safetensors", {"revision": COMMIT, "token": "secret", "cache_dir": tmp_path, "force_download": True}),
    ]  # fmt: skip


def test_from_the_cache_alone_nothing_else_is_asked(hub: SimpleNamespace):
    with pytest.raises(InputError, match="a repository in the cache, found not in the cache; download it once"):
        SemGS.from_pretrained("owner/rooms", local_files_only=True)
    load("small").save_pretrained(hub.folder)
    assert same(SemGS.from_pretrained("owner/rooms", local_files_only=True, revision="v2"), load("small"))
    assert [call[0] for call in hub.asked] == ["snapshot", "snapshot"]
    assert hub.asked[1][2] == {"revision": "v2", "local_files_only": True, "allow_patterns": "*.safetensors"}
    with pytest.raises(InputError, match=f"expected sha256 {'0' * 64}"):
        SemGS.from_pretrained(f"hf://owner/rooms@sha256:{'0' * 64}", local_files_only=True)
    shutil.copy(hub.folder / "model.safetensors", hub.folder / "old.safetensors")
    with pytest.raises(InputError, match=r"found model\.safetensors, old\.safetensors"):
        SemGS.from_pretrained("owner/rooms", local_files_only=True)


def test_saving_may_upload_too_and_a_page_that_is_there_stays(hub: SimpleNamespace, tmp_path: Path):
    (tmp_path / "rooms").mkdir()
    (tmp_path / "rooms" / "README.md").write_text("my own")
    assert (
        load("small").save_pretrained(tmp_path / "rooms", push_to_hub=True, repo_id="owner/rooms").startswith("https")
    )
    assert (hub.folder / "README.md").read_text() == "my own"


@pytest.mark.parametrize("name", ["rooms", "owner/rooms/x", "../rooms", "owner/ro oms", ""])
def test_names_that_are_no_repository_are_refused_before_anything_is_written(
    hub: SimpleNamespace, tmp_path: Path, name: str
):
    with pytest.raises(InputError, match="a repository OWNER/NAME"):
        load("small").push_to_hub(name)
    with pytest.raises(InputError, match="a repository OWNER/NAME"):
        load("small").save_pretrained(tmp_path / "new", push_to_hub=True, repo_id=name or None)
    assert not (tmp_path / "new").exists()
    assert hub.asked == []


def test_what_the_hub_says_is_one_line_without_the_token(hub: SimpleNamespace):
    hub.error = RuntimeError("403 Forbidden\nmore")
    with pytest.raises(InputError) as told:
        load("small").push_to_hub("owner/rooms", token="secret")
    assert str(told.value) == "owner/rooms: expected a repository on the hub that takes uploads, found 403 Forbidden"


def test_a_folder_without_weights_and_a_missing_library_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(InputError, match=r"a folder with model\.safetensors, found none"):
        SemGS.from_pretrained(tmp_path)
    monkeypatch.setitem(sys.modules, "huggingface_hub", None)
    for try_it in (lambda: SemGS.from_pretrained("owner/rooms"), lambda: load("small").push_to_hub("owner/rooms")):
        with pytest.raises(ImportError, match=r"pip install -e '\.\[hub\]'"):
            try_it()


def test_terms_of_the_data_are_repeated_when_weights_come_back(tmp_path: Path):
    save(tmp_path / "a.safetensors", load("small", "random"), {"data_terms": '[{"text": "ScanNet", "own": true}]'})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TermsWarning)
        load(tmp_path / "a.safetensors").save_pretrained(tmp_path / "b")
    with pytest.warns(TermsWarning, match="terms of their own: ScanNet"):
        SemGS.from_pretrained(tmp_path / "b")
    assert "- ScanNet\n" in (tmp_path / "b" / "README.md").read_text()


def front_matter(text: str) -> dict[str, Any]:
    first, inside, _ = text.split("---\n", 2)
    assert first == ""
    return {key: json.loads(value) for key, value in (line.split(": ", 1) for line in inside.splitlines())}


def test_the_page_says_what_the_header_says(tmp_path: Path):
    load("small").save_pretrained(tmp_path / "rooms", repo_id="owner/rooms")
    text = (tmp_path / "rooms" / "README.md").read_text()
    assert front_matter(text) == {
        "library_name": "semgs",
        "pipeline_tag": "image-to-3d",
        "tags": ["gaussian-splatting", "semantic-segmentation", "depth-estimation", "3d-reconstruction"],
        "license": "apache-2.0",
    }
    assert "\n# rooms\n" in text
    assert 'SemGS.from_pretrained("owner/rooms")' in text
    assert "- **Classes**: 20 of the table scannet20: wall, floor, " in text
    assert "CC0-1.0 rooms drawn by semgs" in text
    assert "| other world, 2 | miou | 0.511 | 0.436 to 0.623 |" in text


def test_the_front_matter_is_read_by_the_hubs_own_library(tmp_path: Path):
    library = pytest.importorskip("huggingface_hub")
    load("small").save_pretrained(tmp_path, repo_id="owner/rooms")
    data = library.ModelCard.load(tmp_path / "README.md").data
    assert (data.library_name, data.license, data.pipeline_tag) == ("semgs", "apache-2.0", "image-to-3d")
    assert data.datasets is None


@pytest.mark.parametrize(
    ("licence", "expected"),
    [(None, {}), ("CC0-1.0", {"license": "cc0-1.0"}), ("Mine: 1", {"license": "other", "license_name": "Mine: 1"})],
)
def test_a_licence_is_stated_as_the_header_has_it(tmp_path: Path, licence: str | None, expected: dict[str, str]):
    save(tmp_path / "a.safetensors", load("small", "random"), {} if licence is None else {"licence": licence})
    text = page(tmp_path / "a.safetensors", "rooms")
    found = front_matter(text)
    assert {key: value for key, value in found.items() if key.startswith("licen")} == expected
    assert f"- **Licence of the weights**: {licence or 'not stated'}\n" in text
    assert "What the weights were trained on is not stated." in text
    assert 'from_pretrained("OWNER/rooms")' in text


def test_loaded_networks_have_these_methods() -> None:
    assert semgs.SemGS is SemGS
    assert isinstance(load("small"), SemGS)
    assert isinstance(load("small", "random"), SemGS)
