"""Networks that go to the Hugging Face hub and come from it: `SemGS.from_pretrained`, `model.save_pretrained` and `model.push_to_hub`.

The names and arguments are those of `huggingface_hub.ModelHubMixin`, but its class is not used: it would make that library, which is an extra, necessary to load any weights;
and it keeps settings in a `config.json`, while our one file has settings, class table and provenance in its header, so that they cannot be separated. A folder has

    model.safetensors    what `semgs.load` reads, also as "hf://OWNER/NAME"; in bfloat16 if no number changes by that, in float32 otherwise
    README.md            the page that the hub shows (`semgs.model.weights.model_page`)
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import torch
from torch import nn
from torch.nn.modules.module import register_module_parameter_registration_hook

from semgs.data.origin.terms import TermsWarning
from semgs.files.atomic import write_text
from semgs.files.errors import InputError, check_type
from semgs.files.paths import typed_path
from semgs.model.build import build
from semgs.model.semgs import SemGS as Network
from semgs.model.weights.header import DESCRIPTION, SCORES, TEMPERATURES, Header, temperatures_text
from semgs.model.weights.hub import HubOptions, check_repository, fetch, is_hub_id, upload
from semgs.model.weights.model_page import page
from semgs.model.weights.weights_file import (
    checksum,
    count_parameters,
    fill,
    read_header,
    read_tensors,
    save,
    stored,
)

WEIGHTS, PAGE = "model.safetensors", "README.md"
"""The files of a folder."""

FAR_LARGER, SMALLEST = 4, 1_000_000
"""A network may have at most this many times the parameters of its file; a file counts as having at least this many."""


class SemGS(Network):
    """The network with the methods of the hub; all else is that of `semgs.model.semgs.SemGS`. `semgs.load` makes such networks.

    Attributes:
        metadata: provenance from the header of the file that it was loaded from; empty without one.
        checksum: of the tensors in that file; None without one.
    """

    def __init__(self, *parts: Any) -> None:
        super().__init__(*parts)
        self.metadata: dict[str, str] = {}
        self.checksum: str | None = None

    @classmethod
    def from_pretrained(
        cls,
        pretrained_model_name_or_path: str | Path,
        *,
        force_download: bool = False,
        token: str | bool | None = None,
        cache_dir: str | Path | None = None,
        local_files_only: bool = False,
        revision: str | None = None,
    ) -> SemGS:
        """A network with its weights, from a folder or from the hub, in evaluation mode with frozen parameters.

        Args:
            pretrained_model_name_or_path: a folder that `save_pretrained` wrote; or "OWNER/NAME", also with "hf://" before it.
            force_download: download again even if the cache has the file.
            token: of the hub, for private repositories; None uses the one that `hf auth login` stored.
            cache_dir: where downloads are kept; None is the cache of huggingface_hub.
            local_files_only: use the cache alone, without a network.
            revision: a branch, a tag or a commit.

        Raises:
            InputError: there is neither such a folder nor such a repository, or its weights cannot be used.
            ImportError: it is on the hub, and huggingface_hub is not installed.
        """
        check_type(
            "a folder or repository is", pretrained_model_name_or_path, (str, PathLike), 'a folder, or "OWNER/NAME"'
        )
        given = str(pretrained_model_name_or_path)
        if Path(given).is_dir():
            path = Path(given) / WEIGHTS
            if not path.is_file():
                raise InputError(given, f"a folder with {WEIGHTS}", "none")
        else:
            text = given if is_hub_id(given) else f"hf://{given}"
            path = fetch(text, HubOptions(revision, cache_dir, local_files_only, token, force_download))
        model = open_weights(path, read_header(path), stacklevel=3)
        return model.eval().requires_grad_(False)

    def save_pretrained(
        self,
        save_directory: str | Path,
        *,
        repo_id: str | None = None,
        push_to_hub: bool = False,
        metadata: Mapping[str, str] | None = None,
        **push_to_hub_options: Any,
    ) -> str | None:
        """Write the weights and a page about them into a folder, which may exist. A page that is there already stays.

        `from_pretrained` gives exactly the same network back.

        Args:
            save_directory: the folder.
            repo_id: "OWNER/NAME", for the example on the page and for `push_to_hub`; by default the name of the folder.
            push_to_hub: also upload the folder; further arguments are those of `push_to_hub`.
            metadata: provenance for the header, such as "licence" and "description". The rest is kept from the file that the network was loaded from; if its
                numbers have changed since, without scores and with a description that says so.

        Returns:
            The address of the commit with `push_to_hub`, else None.

        Raises:
            InputError: the hub refuses the upload.
            ValueError: the file format itself uses a key of the metadata.
            OSError: the folder cannot be written.
        """
        folder = typed_path(save_directory)
        if push_to_hub:
            check_repository(repo_id or folder.name)
        folder.mkdir(parents=True, exist_ok=True)
        dtype = self._smallest_exact()
        header = self._provenance(dtype) | dict(metadata or {})
        save(folder / WEIGHTS, self, header, dtype)
        if not (folder / PAGE).exists():
            write_text(folder / PAGE, page(folder / WEIGHTS, repo_id or folder.name))
        if push_to_hub:
            return upload(folder, repo_id or folder.name, **push_to_hub_options)
        return None

    def push_to_hub(
        self,
        repo_id: str,
        *,
        commit_message: str = "Weights of SemGS",
        private: bool | None = None,
        token: str | None = None,
        branch: str | None = None,
        create_pr: bool | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> str:
        """Upload the weights and a page about them. A repository that does not exist is created.

        Args:
            repo_id: "OWNER/NAME".
            commit_message: of the upload.
            private: whether a new repository is private; None leaves that to the hub.
            token: of the hub, with the right to write; None uses the one that `hf auth login` stored.
            branch: to upload to; None is the main branch.
            create_pr: open a pull request instead.
            metadata: as for `save_pretrained`.

        Returns:
            The address of the commit.

        Raises:
            InputError: the id has another form, or the hub refuses the upload.
            ImportError: huggingface_hub is not installed.
        """
        check_repository(repo_id)
        with TemporaryDirectory() as folder:
            self.save_pretrained(folder, repo_id=repo_id, metadata=metadata)
            return upload(
                Path(folder), repo_id, commit_message=commit_message, private=private, token=token, branch=branch, create_pr=create_pr
            )  # fmt: skip

    def _smallest_exact(self) -> torch.dtype:
        """The smallest type of file in which every number stays as it is."""
        numbers = [one for one in self.state_dict().values() if one.is_floating_point()]
        exact = all(torch.equal(one, one.to(torch.bfloat16).to(one.dtype)) for one in numbers)
        return torch.bfloat16 if exact else torch.float32

    def _provenance(self, dtype: torch.dtype) -> dict[str, str]:
        """What the header may still say of the weights."""
        kept = dict(self.metadata)
        if kept and checksum(stored(self, dtype)) != self.checksum:
            kept.pop(SCORES, None)
            kept[DESCRIPTION] = f"changed after loading; before: {kept.get(DESCRIPTION, 'no description')}"
        kept.pop(TEMPERATURES, None)
        if self.temperatures is not None:
            kept[TEMPERATURES] = temperatures_text(self.temperatures)
        return kept


def open_weights(path: Path, header: Header, stacklevel: int) -> SemGS:
    """The network of a weights file, filled with its tensors; a `TermsWarning` repeats terms of their own of the data it was trained on.

    Args:
        path: the file.
        header: its header.
        stacklevel: of the warning.

    Raises:
        InputError: it is damaged, or its tensors do not fit.
    """
    with as_large_as(path):
        model = build(header.settings, header.classes, SemGS)
    assert isinstance(model, SemGS)
    fill(model, read_tensors(path), path, model.name)
    model.origin = f"{path.name}: {header.metadata.get(DESCRIPTION, 'no description')}"
    model.temperatures = header.temperatures
    model.metadata, model.checksum = dict(header.metadata), header.checksum
    if owned := [one.text for one in header.terms if one.own]:
        said = f"{path.name} was trained on data with terms of their own: {'; '.join(owned)}"
        warnings.warn(said, TermsWarning, stacklevel)
    return model


@contextmanager
def as_large_as(path: Path) -> Iterator[None]:
    """Around building the network of a file: refuse one far larger than the file, before it takes all memory.

    Raises:
        InputError: the network is too large, or cannot be built from the settings.
    """
    most = FAR_LARGER * max(count_parameters(path), SMALLEST)

    def check(module: nn.Module, name: str, parameter: nn.Parameter | None) -> None:
        nonlocal most
        most -= 0 if parameter is None else parameter.numel()
        if most < 0:
            raise ValueError("settings of a network far larger than the file")

    hook = register_module_parameter_registration_hook(check)  # called before a parameter takes memory
    try:
        yield
    except InputError:
        raise
    except (TypeError, ValueError, RuntimeError, ArithmeticError) as error:
        raise InputError(path, "settings of its network", f"{error}", key="settings") from None
    finally:
        hook.remove()
