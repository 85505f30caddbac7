"""The weights file: safetensors, with settings, class table and provenance in its header. Nothing is ever unpickled."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from math import prod
from pathlib import Path

import torch
from torch import nn

from semgs.files.atomic import write_bytes
from semgs.files.contents import LFS_POINTER, check_fetched
from semgs.files.errors import InputError, readable
from semgs.files.paths import check_utf8
from semgs.files.tensor_files import open_tensors, tensor_bytes
from semgs.model.semgs import SemGS
from semgs.model.weights.header import CHECKSUM, OWN_KEYS, Header, Score, format_fields
from semgs.rendering.temperatures import Temperatures

WEIGHTS = "a safetensors file of weights"


def save(path: str | Path, model: SemGS, metadata: dict[str, str], dtype: torch.dtype = torch.bfloat16) -> None:
    """Write a network's weights, atomically.

    Args:
        path: the file.
        model: the network; its settings and class table go into the header.
        metadata: provenance; its keys must not be those of the format (`OWN_KEYS`).
        dtype: in which floating-point tensors are stored; the network computes in float32.

    Raises:
        ValueError: the format itself uses a key of the metadata.
    """
    _check_free(metadata)
    tensors = stored(model, dtype)
    header = format_fields(model.settings, model.classes, checksum(tensors))
    write_bytes(Path(path), tensor_bytes(tensors, header | metadata))


def stored(model: SemGS, dtype: torch.dtype) -> dict[str, torch.Tensor]:
    """The tensors of a network as `save` stores them, floating-point ones in this type."""
    return {
        name: tensor.detach().to("cpu", dtype if tensor.is_floating_point() else tensor.dtype).contiguous()
        for name, tensor in model.state_dict().items()
    }


def restate(source: str | Path, target: str | Path, metadata: Mapping[str, str]) -> None:
    """Write weights again with other provenance, atomically; the tensors and their types are exactly the same.

    Args:
        source: a weights file of semgs.
        target: the file to write; it may be the same.
        metadata: replaces the header's values under these keys; the others stay.

    Raises:
        InputError: the source is not a weights file of semgs, or it is damaged.
        ValueError: the format itself uses a key of the metadata.
    """
    read_header(source)
    _check_free(metadata)
    header, tensors = _content(source)
    write_bytes(Path(target), tensor_bytes(tensors, header | {CHECKSUM: checksum(tensors)} | dict(metadata)))


def checksum(tensors: Mapping[str, torch.Tensor]) -> str:
    """SHA-256 of tensors as they are stored, in the order of their names: for each a line with name, type and shape, then its bytes."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        digest.update(f"{name} {tensor.dtype} {list(tensor.shape)}\n".encode())
        digest.update(tensor.contiguous().flatten().view(torch.uint8).numpy().data)
    return digest.hexdigest()


def _check_free(metadata: Mapping[str, str]) -> None:
    """Refuse provenance under keys that the format itself uses."""
    if taken := OWN_KEYS & metadata.keys():
        raise ValueError(f"metadata has the key {sorted(taken)[0]!r}, which the format itself uses")


def is_ours(path: str | Path) -> bool:
    """Whether a file is safetensors with the header of semgs.

    Raises:
        InputError: it cannot be read, or Git LFS has not fetched it.
    """
    check_utf8(path, "safetensors")
    with readable(path), Path(path).open("rb") as opened:  # safetensors reports a file without permission as missing
        beginning = opened.read(len(LFS_POINTER))
    check_fetched(Path(path), beginning, WEIGHTS)
    try:
        with open_tensors(path, WEIGHTS) as file:
            return "semgs" in (file.metadata() or {})
    except InputError:
        return False


def read_header(path: str | Path) -> Header:
    """The header of a weights file.

    Raises:
        InputError: it is not a weights file of semgs, or of another version.
    """
    with open_tensors(path, WEIGHTS) as file:
        fields = file.metadata() or {}
    return Header.decoded(path, fields)


def read_scores(path: str | Path) -> tuple[Score, ...]:
    """The scores in the header of a weights file; none if it states none.

    Raises:
        InputError: the file is not one of semgs, or its scores are invalid.
    """
    return read_header(path).scores


def read_temperatures(path: str | Path) -> Temperatures | None:
    """The temperatures in the header of a weights file; None if it states none.

    Raises:
        InputError: the file is not one of semgs, or a temperature is not a positive number.
    """
    return read_header(path).temperatures


MEASURED = ("running_mean", "running_var", "num_batches_tracked", "mixture.known")
"""Last parts of the names of tensors that no gradient changes: a batch norm's statistics, and which classes a second network knows."""


def count_parameters(path: str | Path) -> int:
    """The number of parameters in a safetensors file, without those that no gradient changes; its tensors are not read.

    Raises:
        InputError: the file cannot be read.
    """
    with open_tensors(path, WEIGHTS) as file:
        names = [name for name in file.keys() if not name.endswith(MEASURED)]  # noqa: SIM118
        return sum(prod(file.get_slice(name).get_shape()) for name in names)


def read_tensors(path: str | Path) -> dict[str, torch.Tensor]:
    """All tensors of a safetensors file, in float32.

    Raises:
        InputError: the file cannot be read, or is damaged.
    """
    return {name: _single(tensor) for name, tensor in _content(path)[1].items()}


def _content(path: str | Path) -> tuple[dict[str, str], dict[str, torch.Tensor]]:
    """The metadata of a safetensors file and its tensors as they are stored."""
    with open_tensors(path, "a complete safetensors file") as file:
        header = dict(file.metadata() or {})
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    if "semgs" in header and header.get(CHECKSUM, found := checksum(tensors)) != found:
        raise InputError(
            path, f"tensors with sha256 {header[CHECKSUM][:12]}", f"{found[:12]}",
            key=CHECKSUM, advice="the file is damaged; download or copy it again",
        )  # fmt: skip
    return header, tensors


def fill(model: nn.Module, tensors: dict[str, torch.Tensor], path: str | Path, of: str) -> None:
    """Fill a network with the tensors of a file. They must match exactly; on an error the network is unchanged.

    Args:
        model: the network.
        tensors: of the file.
        path: the file, for errors.
        of: name of the network, for errors.

    Raises:
        InputError: a tensor is missing, unknown, of another shape or not finite; it is named.
    """
    wanted = model.state_dict()
    for name, tensor in wanted.items():
        if name not in tensors:
            raise InputError(path, f"a tensor of shape {tuple(tensor.shape)}, as in {of}", "none", key=name)
        if tensors[name].shape != tensor.shape:
            shape = f"shape {tuple(tensor.shape)}, as in {of}"
            raise InputError(path, shape, f"{tuple(tensors[name].shape)}", key=name)
    if extra := sorted(tensors.keys() - wanted.keys()):
        raise InputError(path, f"the {len(wanted)} tensors of {of}", "one more", key=extra[0])
    for name, tensor in tensors.items():
        if not torch.isfinite(tensor).all():
            raise InputError(path, "finite numbers", "one that is not", key=name)
    model.load_state_dict(tensors)


def _single(tensor: torch.Tensor) -> torch.Tensor:
    return tensor.float() if tensor.is_floating_point() else tensor
