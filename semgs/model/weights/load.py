"""Load networks by name, file or hub id, from weights of ours or MVSplat's checkpoints, whose tensors are mapped to ours."""

from __future__ import annotations

import re
from pathlib import Path
from pickle import UnpicklingError

import torch

from semgs.data.origin.terms import Terms
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.files.paths import found_at, typed_path
from semgs.model.build import build
from semgs.model.gaussians.heads import PaperDecoder
from semgs.model.networks import NAMES, NETWORKS
from semgs.model.settings import NetworkSettings
from semgs.model.weights.header import DATA_TERMS
from semgs.model.weights.hub import SCHEME, fetch, is_hub_id
from semgs.model.weights.index import shipped_folder
from semgs.model.weights.pretrained import SemGS, open_weights
from semgs.model.weights.weights_file import fill, is_ours, read_header, read_tensors

MVSPLAT = Terms("MVSplat's published weights, under their own terms: https://github.com/donydchen/mvsplat", own=True)
"""Terms of MVSplat's checkpoint, which has no header."""


def load(
    name: str | Path, weights: str | Path | None = None, *, seed: int = 0, classes: ClassTable = SCANNET20
) -> SemGS:
    """A network with its weights, ready to use. Its `origin` says in one sentence where the weights come from.

    It is in evaluation mode with frozen parameters, so its outputs carry no gradient and need no `detach`; gradients with respect to
    the views still flow. To train it, call `model.train().requires_grad_()`; `semgs train` does so itself. If a scene does not fit into
    memory, the network refuses it before encoding, with a `NotEnoughMemoryError` (a `MemoryError`) that says what would fit.

    If the weights were trained on data with terms of their own (such as ScanNet's), a `TermsWarning` repeats them.

    Args:
        name: "small", "base" or "mvsplat"; or, without `weights`, a file or hub id, which states its network.
        weights: None uses the included weights; "random" initialises them at random; a path loads a weights file, or MVSplat's
            checkpoint (`.ckpt` or safetensors) for "mvsplat" and for "base", whose semantic branch is then random; a hub id
            ("hf://owner/name", `semgs.model.weights.hub`) is downloaded first.
        seed: of random weights.
        classes: the class table that the weights must have been trained on.

    Raises:
        ValueError: there is no network of that name, or no included weights for it.
        InputError: the file cannot be read or downloaded, or does not fit; the tensor or class table is named.
        ImportError: a hub id is given and huggingface_hub is not installed.
    """
    if weights is None and (is_hub_id(name) or found_at(typed_path(name)) == "a file"):
        name, weights = find(name)
    name = str(name)
    if name not in NAMES:
        raise ValueError(f"unknown model {name!r}; known: {', '.join(NAMES)}, a weights file, {SCHEME}OWNER/NAME")
    if weights is None:
        weights = shipped(name)
        if weights is None:
            raise ValueError(
                f'there are no included weights for "{name}"; pass a file, or weights="random" for an untrained network'
            )
    if str(weights) == "random":
        return _ready(untrained(NETWORKS[name](), seed, classes))
    path = _local(weights)
    if (found := found_at(path)) != "a file":
        raise InputError(path, "a weights file", found)
    if is_ours(path):
        return _ready(_ours(name, path, classes))
    return _ready(_mvsplats(name, path, seed, classes))


def other_table(path: Path, wanted: ClassTable, found: ClassTable, advice: str | None = None) -> InputError:
    """The error for weights with another class table."""
    expected, there = (f"{one.name} ({len(one)} classes)" for one in (wanted, found))
    return InputError(path, f"class table {expected}", there, key="classes", advice=advice)


def _ready(model: SemGS) -> SemGS:
    """The network in evaluation mode, with frozen parameters."""
    return model.eval().requires_grad_(False)


def find(weights: str | Path) -> tuple[str, Path]:
    """The network's name and the weights file, from the name of included weights ("small"), a path or a hub id.

    Any file without the header of semgs is treated as MVSplat's checkpoint.

    Raises:
        ValueError: there are no included weights of that name.
        InputError: there is no such file, it cannot be downloaded, or its header is damaged.
        ImportError: a hub id is given and huggingface_hub is not installed.
    """
    path = _local(weights)
    if str(weights) in NAMES:
        inside = shipped(str(weights))
        if inside is None:
            raise ValueError(f'there are no included weights for "{weights}"; name a file')
        return str(weights), inside
    if (found := found_at(path)) != "a file":
        names = [name for name in NAMES if shipped(name)]
        raise InputError(path, f"a weights file, or {' or '.join(names)}", found)
    return (read_header(path).settings.name if is_ours(path) else "mvsplat"), path


def table_of(path: str | Path) -> ClassTable:
    """The class table of a weights file; the package's own if the file does not say.

    Raises:
        InputError: its header is damaged.
    """
    return (read_header(path).classes if is_ours(path) else None) or SCANNET20


def trained_scenes(weights: str | Path) -> tuple[str, ...]:
    """The names of the scenes that weights were trained on, if they say so; never generated rooms or MVSplat's videos.

    Raises:
        ValueError: there are no included weights of that name.
        InputError: there is no such file, or its header is damaged.
    """
    _, path = find(weights)
    return read_header(path).scenes if is_ours(path) else ()


def data_terms(weights: str | Path) -> tuple[Terms, ...]:
    """The terms of the data that weights were trained on, if they say so.

    Raises:
        ValueError: there are no included weights of that name.
        InputError: there is no such file, or its header is damaged.
    """
    _, path = find(weights)
    if not is_ours(path):
        return (MVSPLAT,)
    header = read_header(path)
    if DATA_TERMS not in header.metadata:
        return (Terms(f"what {path.name} was trained on: terms not stated"),)
    return header.terms


def untrained(settings: NetworkSettings, seed: int, classes: ClassTable | None = SCANNET20) -> SemGS:
    """An untrained network with these settings; the caller's random state does not change."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        model = build(settings, classes, SemGS)
    assert isinstance(model, SemGS)
    model.origin = f"untrained: drawn at random with seed {seed}"
    return model


def shipped(name: str) -> Path | None:
    """The included weights file of that name, None if there is none."""
    path = shipped_folder() / f"{name}.safetensors"
    return path if path.is_file() else None


def _local(weights: str | Path) -> Path:
    """The path of weights; those on the hub are downloaded."""
    return fetch(str(weights)) if is_hub_id(weights) else typed_path(weights)


def _ours(name: str, path: Path, classes: ClassTable) -> SemGS:
    header = read_header(path)
    if header.settings.name != name:
        raise InputError(path, f'weights of "{name}"', f'weights of "{header.settings.name}"', key="settings.name")
    if header.classes is not None and header.classes != classes:
        raise other_table(path, classes, header.classes)
    return open_weights(path, header, stacklevel=4)


def _mvsplats(name: str, path: Path, seed: int, classes: ClassTable) -> SemGS:
    if name.startswith("small"):
        raise InputError(path, f'weights of "{name}", written by semgs', "another file")
    return from_mvsplat(untrained(NETWORKS[name](), seed, classes), path, seed)


def semantic_tensors(model: SemGS) -> frozenset[str]:
    """Names of the tensors of a network's semantic branch."""
    return frozenset(name for name in model.state_dict() if name.startswith("semantic."))


HEADS = "colour.heads."
"""Beginning of the tensor names of the colour branch's heads."""


def from_mvsplat(model: SemGS, path: Path, seed: int) -> SemGS:
    """The network, which was initialised with this seed, with colour branch and depth from MVSplat's checkpoint.

    Heads as in the paper's text have other layers than MVSplat's and stay as initialised: the paper loads the extractor and the depth network, and does not name heads.

    Raises:
        InputError: the file cannot be read or does not fit; the tensor is named.
    """
    tensors = read_mvsplat(path)
    own = model.state_dict()
    foreign = renamed(tensors, path)
    drawn = {"the semantic branch": semantic_tensors(model)}
    if isinstance(model.colour.heads, PaperDecoder):
        foreign = {key: value for key, value in foreign.items() if not key.startswith(HEADS)}
        drawn["the colour heads"] = frozenset(key for key in own if key.startswith(HEADS))
    fresh = {key: own[key] for part in drawn.values() for key in part if key not in foreign}
    fill(model, foreign | fresh, path, model.name)
    counts = [f"{count} tensors of {part}" for part, keys in drawn.items() if (count := len(keys & fresh.keys()))]
    model.origin = (
        f"{path.name}: {'all ' if len(foreign) == len(tensors) else ''}{len(foreign)} tensors of MVSplat taken"
        + (f"; {' and '.join(counts)} drawn at random with seed {seed}" if counts else "")
    )
    return model


PREFIXES = {
    "backbone.backbone.": "cnn.",
    "backbone.transformer.": "colour.transformer.swin.",
    "depth_predictor.corr_refine_net.": "colour.depth.regressor.refine.",
    "depth_predictor.regressor_residual.": "colour.depth.regressor.residual.",
    "depth_predictor.depth_head_lowres.": "colour.depth.regressor.head.",
    "depth_predictor.upsampler.0.": "colour.heads.upsampler.conv.",
    "depth_predictor.proj_feature.": "colour.heads.refinement.project.",
    "depth_predictor.refine_unet.": "colour.heads.refinement.refine.",
    "depth_predictor.to_disparity.": "colour.heads.refinement.to_disparity.",
    "depth_predictor.to_gaussians.": "colour.heads.colour.",
}
"""Beginnings of MVSplat's names (without the leading "encoder.") and of ours; the rest is the same."""


def our_name(name: str) -> str | None:
    """Our name of one of MVSplat's tensors, None if there is none."""
    name = name.removeprefix("encoder.")
    for theirs, ours in PREFIXES.items():
        if name.startswith(theirs):
            return ours + name.removeprefix(theirs)
    return None


def read_mvsplat(path: Path) -> dict[str, torch.Tensor]:
    """The tensors of a checkpoint: safetensors, or Lightning's `.ckpt` read without unpickling objects.

    Raises:
        InputError: it is neither, or contains more than tensors and plain containers.
    """
    with path.open("rb") as file:
        zipped = file.read(2) == b"PK"
    if not zipped:
        return read_tensors(path)
    try:
        checkpoint = torch.load(path, map_location="cpu", weights_only=True)
    except UnpicklingError as error:
        found = re.search(r"(?:GLOBAL|global) (\S+)", str(error))
        raise InputError(
            path, "a checkpoint of tensors alone (torch.load with weights_only=True)",
            f"an object, {found[1]}" if found else "objects",
            advice="if you trust it, extract its tensors once: see docs/reproduce.md",
        ) from None  # fmt: skip
    except Exception as error:  # torch raises many kinds on a broken or hostile archive; some advise to unpickle it
        kind = "a TorchScript archive" if "TorchScript" in str(error) else f"a broken one ({type(error).__name__})"
        raise InputError(path, "a checkpoint that loads with weights_only=True", kind) from None
    state = checkpoint.get("state_dict") if isinstance(checkpoint, dict) else None
    if not isinstance(state, dict) or not all(isinstance(value, torch.Tensor) for value in state.values()):
        raise InputError(path, "a dictionary of tensors", "none", key="state_dict")
    return {name: tensor.float() for name, tensor in state.items()}


def renamed(tensors: dict[str, torch.Tensor], path: Path) -> dict[str, torch.Tensor]:
    """The same tensors under our names.

    Raises:
        InputError: one of them is not MVSplat's.
    """
    ours = {}
    for name, tensor in tensors.items():
        own = our_name(name)
        if own is None:
            raise InputError(path, "MVSplat's encoder alone", "another tensor", key=name)
        ours[own] = tensor
    return ours
