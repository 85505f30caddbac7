"""Weights on the Hugging Face hub: `hf://OWNER/NAME[@REVISION][@sha256:HASH]`, downloaded on request and checked against a hash.

The form is the hub's own ("hf://" URIs of `huggingface_hub`) and cannot be confused with a path. Only one safetensors file is
downloaded, into the cache of that library. `upload` puts a folder there. No torch.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from semgs.files.contents import sha256
from semgs.files.errors import InputError, check_type, needs_extra

SCHEME = "hf://"
FORM = f"{SCHEME}OWNER/NAME, optionally followed by @REVISION or @sha256:HASH"
REPOSITORY = r"\w[\w.-]*/\w[\w.-]*"
File = TypeVar("File")
ADVICE = "download the file by other means and name its path"


@dataclass(frozen=True)
class HubId:
    """Weights on the hub.

    Attributes:
        repository: "owner/name".
        revision: a branch, a tag or a commit; None is the main branch.
        sha256: hash that the file must have; None uses the one that the repository states.
    """

    repository: str
    revision: str | None = None
    sha256: str | None = None

    @classmethod
    def parsed(cls, text: str) -> HubId:
        """From text.

        Raises:
            InputError: the text has another form.
        """
        match = re.fullmatch(rf"{SCHEME}({REPOSITORY})(?:@(?!sha256:)([\w./-]+))?(?:@sha256:([0-9a-f]{{64}}))?", text)
        if match is None:
            raise InputError(text, FORM, "something else")
        return cls(match[1], match[2], match[3])


def is_hub_id(weights: str | Path) -> bool:
    """Whether the name of weights is a hub id; a path never is."""
    return isinstance(weights, str) and weights.startswith(SCHEME)


@dataclass(frozen=True)
class HubOptions:
    """How to download.

    Attributes:
        revision: a branch, a tag or a commit; None is that of the id, or the main branch.
        cache_dir: where downloads are kept; None is the library's own cache.
        local_files_only: use the cache alone, without a network.
        token: for private repositories; None uses the stored one, False none.
        force_download: download again even if the cache has the file.
    """

    revision: str | None = None
    cache_dir: str | Path | None = None
    local_files_only: bool = False
    token: str | bool | None = None
    force_download: bool = False

    @property
    def of_access(self) -> dict[str, Any]:
        """Arguments of every call of the library."""
        return {} if self.token is None else {"token": self.token}

    @property
    def of_download(self) -> dict[str, Any]:
        """Arguments of a download."""
        found: dict[str, Any] = {} if self.cache_dir is None else {"cache_dir": self.cache_dir}
        return self.of_access | found | ({"force_download": True} if self.force_download else {})


def fetch(text: str, options: HubOptions = HubOptions()) -> Path:
    """The weights file of a hub id, from the hub or from its library's cache, checked against the repository's hash.

    From the cache alone the repository's hash is unknown; the hash in the header of our files is checked when they are read.

    Args:
        text: the id.
        options: how to download.

    Raises:
        InputError: it is not an id; the hub cannot be reached or does not have it; the repository does not have exactly one safetensors
            file or states no hash; or the hash differs.
        ImportError: huggingface_hub is not installed; the message names the extra.
    """
    requested = HubId.parsed(text)
    revision = options.revision or requested.revision
    with needs_extra("hub", "weights on the hub need huggingface_hub", "huggingface_hub"):
        from huggingface_hub import HfApi, hf_hub_download
    if options.local_files_only:
        return _cached(text, requested, revision, options)
    with _library_errors(text, "a repository on the hub", ADVICE):
        repository = HfApi(**options.of_access).model_info(requested.repository, revision=revision, files_metadata=True)
    files = [one for one in repository.siblings or [] if one.rfilename.endswith(".safetensors")]
    file = _only(files, [one.rfilename for one in files], text, "a repository with one safetensors file", ADVICE)
    stated = file.lfs.sha256 if file.lfs else None
    expected = requested.sha256 or stated
    if expected is None:
        known = "a file whose sha256 the repository states"
        raise InputError(text, known, "one outside LFS", file.rfilename, "give it: @sha256:HASH")
    if stated not in (None, expected):
        raise InputError(text, f"sha256 {expected}", f"{stated}, as the repository states", file.rfilename)
    with _library_errors(text, f"{file.rfilename} from the hub", ADVICE):
        commit = repository.sha  # not the branch, which may have moved since
        path = hf_hub_download(requested.repository, file.rfilename, revision=commit, **options.of_download)
    return _checked(Path(path), expected, text)


def _cached(text: str, requested: HubId, revision: str | None, options: HubOptions) -> Path:
    """The weights file of a hub id, from the cache alone."""
    from huggingface_hub import snapshot_download

    advice = "download it once with a network"
    with _library_errors(text, "a repository in the cache", advice):
        folder = snapshot_download(
            requested.repository, revision=revision, local_files_only=True, allow_patterns="*.safetensors", **options.of_download
        )  # fmt: skip
    files = sorted(Path(folder).rglob("*.safetensors"))
    path = _only(files, [file.name for file in files], text, "one safetensors file in the cache", advice)
    return _checked(path, requested.sha256, text)


def _only(files: Sequence[File], names: Sequence[str], text: str, expected: str, advice: str) -> File:
    """The one file of a hub id; an error names those that there are."""
    if len(files) != 1:
        raise InputError(text, expected, ", ".join(names) or "none", advice=advice)
    return files[0]


def _checked(path: Path, expected: str | None, text: str) -> Path:
    """The file of a hub id, whose hash must be this one; None allows any."""
    if expected is not None and (found := sha256(path)) != expected:
        raise InputError(path, f"sha256 {expected}, as of {text}", found, advice="delete it and download it again")
    return path


def check_repository(repository: str) -> None:
    """Check the name of a repository before long work starts.

    Raises:
        InputError: it is not "OWNER/NAME".
    """
    check_type("a repository is", repository, str, '"OWNER/NAME"')
    if not re.fullmatch(REPOSITORY, repository):
        raise InputError(repository, "a repository OWNER/NAME", "something else")


def upload(
    folder: Path,
    repository: str,
    *,
    commit_message: str = "Weights of SemGS",
    private: bool | None = None,
    token: str | None = None,
    branch: str | None = None,
    create_pr: bool | None = None,
) -> str:
    """Upload the files of a folder in one commit. A repository that does not exist is created.

    Args:
        folder: with the files.
        repository: "OWNER/NAME".
        commit_message: of the upload.
        private: whether a new repository is private; None leaves that to the hub.
        token: with the right to write; None uses the stored one.
        branch: to upload to; None is the main branch.
        create_pr: open a pull request instead.

    Returns:
        The address of the commit.

    Raises:
        InputError: the name has another form, or the hub cannot be reached or refuses.
        ImportError: huggingface_hub is not installed; the message names the extra.
    """
    check_repository(repository)
    with needs_extra("hub", "uploads to the hub need huggingface_hub", "huggingface_hub"):
        from huggingface_hub import HfApi
    api = HfApi(token=token)
    with _library_errors(repository, "a repository on the hub that takes uploads"):
        created = api.create_repo(repo_id=repository, private=private, exist_ok=True).repo_id
        commit = api.upload_folder(
            repo_id=created, repo_type="model", folder_path=folder, commit_message=commit_message, revision=branch, create_pr=create_pr
        )  # fmt: skip
    return str(commit)


@contextmanager
def _library_errors(text: str, expected: str, advice: str | None = None) -> Iterator[None]:
    """Turn any error of the library into one line; it passes on errors of its HTTP client, which changes between versions."""
    try:
        yield
    except Exception as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise InputError(text, expected, reason, advice=advice) from None
