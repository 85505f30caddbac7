"""Weights on the Hugging Face hub: `hf://OWNER/NAME[@REVISION][@sha256:HASH]`, downloaded on request and checked against a hash.

The form is the hub's own ("hf://" URIs of `huggingface_hub`) and cannot be confused with a path. Only one safetensors file is
downloaded, into the cache of that library. No torch.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.extras import needs_extra
from semgs.files.hashes import sha256

SCHEME = "hf://"
FORM = f"{SCHEME}OWNER/NAME, optionally followed by @REVISION or @sha256:HASH"
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
        word = r"\w[\w.-]*"
        match = re.fullmatch(rf"{SCHEME}({word}/{word})(?:@(?!sha256:)([\w./-]+))?(?:@sha256:([0-9a-f]{{64}}))?", text)
        if match is None:
            raise InputError(text, FORM, "something else")
        return cls(match[1], match[2], match[3])


def is_hub_id(weights: str | Path) -> bool:
    """Whether the name of weights is a hub id; a path never is."""
    return isinstance(weights, str) and weights.startswith(SCHEME)


def fetch(text: str) -> Path:
    """The weights file of a hub id, from the hub or from its library's cache, checked against the repository's hash.

    Args:
        text: the id.

    Raises:
        InputError: it is not an id; the hub cannot be reached or does not have it; the repository does not have exactly one safetensors
            file or states no hash; or the hash differs.
        ImportError: huggingface_hub is not installed; the message names the extra.
    """
    requested = HubId.parsed(text)
    with needs_extra("hub", "weights on the hub need huggingface_hub", "huggingface_hub"):
        from huggingface_hub import HfApi, hf_hub_download
    try:
        repository = HfApi().model_info(requested.repository, revision=requested.revision, files_metadata=True)
    except Exception as error:  # the library passes on errors of its HTTP client, which changes between versions
        raise InputError(text, "a repository on the hub", _reason(error), advice=ADVICE) from None
    files = [sibling for sibling in repository.siblings or [] if sibling.rfilename.endswith(".safetensors")]
    if len(files) != 1:
        names = ", ".join(file.rfilename for file in files) or "none"
        raise InputError(text, "a repository with one safetensors file", names, advice=ADVICE)
    (file,) = files
    stated = file.lfs.sha256 if file.lfs else None
    expected = requested.sha256 or stated
    if expected is None:
        known = "a file whose sha256 the repository states"
        raise InputError(text, known, "one outside LFS", file.rfilename, "give it: @sha256:HASH")
    if stated not in (None, expected):
        raise InputError(text, f"sha256 {expected}", f"{stated}, as the repository states", file.rfilename)
    try:
        # The commit, not the branch, which may have moved since.
        path = Path(hf_hub_download(requested.repository, file.rfilename, revision=repository.sha))
    except Exception as error:
        raise InputError(text, f"{file.rfilename} from the hub", _reason(error), advice=ADVICE) from None
    found = sha256(path)
    if found != expected:
        raise InputError(path, f"sha256 {expected}, as of {text}", found, advice="delete it and download it again")
    return path


def _reason(error: Exception) -> str:
    """The first line of an error."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]
