"""Loading networks by name."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import torch
from torch import nn
from torch.nn.modules.module import register_module_parameter_registration_hook

from semgs.data.classes import SCANNET20, ClassTable
from semgs.data.terms import Terms, TermsWarning, terms_from
from semgs.files.errors import InputError
from semgs.files.paths import found_at, typed_path
from semgs.files.strict_json import parse_json
from semgs.model import networks
from semgs.model.build import build
from semgs.model.semgs import SemGS
from semgs.model.settings import NetworkSettings
from semgs.weights import mvsplat
from semgs.weights.file import count_parameters, fill, is_ours, read_header, read_tensors
from semgs.weights.hub import SCHEME, fetched, is_hub_id
from semgs.weights.index import shipped_folder
from semgs.weights.temperatures import temperatures_in

SCENES = "scenes"
"""Where the header of weights has the names of the scenes that they were trained on."""

DATA_TERMS = "data_terms"
"""Where it has the terms of those data."""

FAR_LARGER, SMALLEST = 4, 1_000_000
"""A network may have so many times the parameters of its file, which count as so many at least."""

MVSPLAT = Terms("MVSplat's published weights, under their own terms: https://github.com/donydchen/mvsplat", own=True)
"""Of its checkpoint, which has no header."""


def load(
    name: str | Path, weights: str | Path | None = None, *, seed: int = 0, classes: ClassTable = SCANNET20
) -> SemGS:
    """A network with its weights, ready to be used; `origin` of it says in one sentence where they come from.

    It is in evaluation mode and its parameters are frozen, so what comes out has no gradient and needs no `detach`. Gradients
    with respect to the views still flow. To train it, `model.train().requires_grad_()`; `semgs train` does so itself. A scene that does not fit
    into memory is refused before it is encoded, with a `NotEnoughMemoryError` (a `MemoryError`) that says what would fit.

    Where they were trained on data with terms of their own (ScanNet's, say), a `TermsWarning` repeats these.

    Args:
        name: "small", "base" or "mvsplat"; or, without `weights`, a file or hub id, which says itself of which it is.
        weights: None takes those that ship with the package; "random" draws them; a path loads a file of ours, or
            MVSplat's checkpoint (`.ckpt` or safetensors) for "mvsplat", and for "base", whose semantic branch is then
            drawn at random; a hub id ("hf://owner/name", `semgs.weights.hub`) fetches a file first.
        seed: of what is drawn.
        classes: the table that the weights must have been trained on.

    Raises:
        ValueError: there is no network of that name, or no weights ship for it.
        InputError: the file cannot be read or fetched, or does not fit: the tensor or table is named.
        ImportError: a hub id is given and huggingface_hub is not installed.
    """
    if weights is None and (is_hub_id(name) or found_at(typed_path(name)) == "a file"):
        name, weights = find(name)
    name = str(name)
    if name not in networks.NAMES:
        raise ValueError(
            f"unknown model {name!r}; known: {', '.join(networks.NAMES)}, a file of weights, {SCHEME}OWNER/NAME"
        )
    if weights is None:
        weights = shipped(name)
        if weights is None:
            raise ValueError(f'no weights ship for "{name}"; pass a file, or weights="random" for an untrained network')
    if str(weights) == "random":
        return _ready(untrained(networks.NETWORKS[name](), seed, classes))
    path = _local(weights)
    if (found := found_at(path)) != "a file":
        raise InputError(path, "a file of weights", found)
    if is_ours(path):
        return _ready(_ours(name, path, classes))
    return _ready(_mvsplats(name, path, seed, classes))


def other_table(path: Path, wanted: ClassTable, found: ClassTable, advice: str | None = None) -> InputError:
    """The error of weights that are made for another class table."""
    expected, there = (f"{one.name} ({len(one)} classes)" for one in (wanted, found))
    return InputError(path, f"class table {expected}", there, key="classes", advice=advice)


def _ready(model: SemGS) -> SemGS:
    """A network in evaluation mode whose parameters are frozen."""
    return model.eval().requires_grad_(False)


def find(weights: str | Path) -> tuple[str, Path]:
    """The network's name and the file of weights that a user called by name ("small"), by path or by hub id.

    A file that is not of ours is taken for MVSplat's checkpoint.

    Raises:
        ValueError: no weights of that name ship with the package.
        InputError: there is no such file, it cannot be fetched, or its header is broken.
        ImportError: a hub id is given and huggingface_hub is not installed.
    """
    path = _local(weights)
    if str(weights) in networks.NAMES:
        inside = shipped(str(weights))
        if inside is None:
            raise ValueError(f'no weights ship for "{weights}"; name a file')
        return str(weights), inside
    if (found := found_at(path)) != "a file":
        names = [name for name in networks.NAMES if shipped(name)]
        raise InputError(path, f"a file of weights, or {' or '.join(names)}", found)
    return (read_header(path).settings.name if is_ours(path) else "mvsplat"), path


def table_of(path: str | Path) -> ClassTable:
    """The class table that a file of weights is made for; the package's own where it does not say.

    Raises:
        InputError: its header is broken.
    """
    return (read_header(path).classes if is_ours(path) else None) or SCANNET20


def trained_scenes(weights: str | Path) -> tuple[str, ...]:
    """The names of the scenes that weights were trained on, as far as they say: rooms drawn live and MVSplat's videos are not among them.

    Raises:
        ValueError: no weights of that name ship.
        InputError: there is no such file, or its header is broken.
    """
    _, path = find(weights)
    if not is_ours(path):
        return ()
    try:
        names = parse_json(read_header(path).metadata.get(SCENES, "[]"))
    except ValueError as error:
        raise InputError(path, "names of scenes as JSON", str(error), key=SCENES) from error
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(path, "a list of names", f"{names!r:.60}", key=SCENES)
    return tuple(names)


def data_terms(weights: str | Path) -> tuple[Terms, ...]:
    """The terms of the data that weights were trained on, as far as they say.

    Raises:
        ValueError: no weights of that name ship.
        InputError: there is no such file, or its header is broken.
    """
    _, path = find(weights)
    if not is_ours(path):
        return (MVSPLAT,)
    metadata = read_header(path).metadata
    if DATA_TERMS not in metadata:
        return (Terms(f"what {path.name} was trained on: terms not stated"),)
    return _terms_in(metadata, path)


def _terms_in(metadata: Mapping[str, str], path: Path) -> tuple[Terms, ...]:
    """The terms that a header states, none where it states none.

    Raises:
        InputError: they cannot be read.
    """
    try:
        return terms_from(metadata.get(DATA_TERMS, "[]"))
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(path, "terms of data as JSON", f"{type(error).__name__}: {error}", key=DATA_TERMS) from error


def untrained(settings: NetworkSettings, seed: int, classes: ClassTable | None = SCANNET20) -> SemGS:
    """An untrained network of these settings; the caller's random state is left as it was."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        model = build(settings, classes)
    model.origin = f"untrained: drawn at random with seed {seed}"
    return model


def shipped(name: str) -> Path | None:
    """The file of weights inside the package, None if there is none."""
    path = shipped_folder() / f"{name}.safetensors"
    return path if path.is_file() else None


def _local(weights: str | Path) -> Path:
    """The path of weights, fetched where they are on the hub."""
    return fetched(str(weights)) if is_hub_id(weights) else typed_path(weights)


def _ours(name: str, path: Path, classes: ClassTable) -> SemGS:
    header = read_header(path)
    if header.settings.name != name:
        raise InputError(path, f'weights of "{name}"', f'weights of "{header.settings.name}"', key="settings.name")
    if header.classes is not None and header.classes != classes:
        raise other_table(path, classes, header.classes)
    with as_large_as(path):
        model = build(header.settings, header.classes)
    fill(model, read_tensors(path), path, model.name)
    if owned := [one.text for one in _terms_in(header.metadata, path) if one.own]:
        told = f"{path.name} was trained on data with terms of their own: {'; '.join(owned)}"
        warnings.warn(told, TermsWarning, stacklevel=3)
    model.origin = f"{path.name}: {header.metadata.get('description', 'no description')}"
    model.temperatures = temperatures_in(header.metadata, path) or {}
    return model


@contextmanager
def as_large_as(path: Path) -> Iterator[None]:
    """Around the building of a network that a file describes: one that is far larger than the file would take memory without end.

    Raises:
        InputError: it is, or the settings make no network.
    """
    most = FAR_LARGER * max(count_parameters(path), SMALLEST)

    def check(module: nn.Module, name: str, parameter: nn.Parameter | None) -> None:
        nonlocal most
        most -= 0 if parameter is None else parameter.numel()
        if most < 0:
            raise ValueError("those of a network far larger than the file")

    hook = register_module_parameter_registration_hook(check)  # before the parameter is touched, and takes memory
    try:
        yield
    except InputError:
        raise
    except (TypeError, ValueError, RuntimeError, ArithmeticError) as error:
        raise InputError(path, "settings of its network", f"{error}", key="settings") from None
    finally:
        hook.remove()


def _mvsplats(name: str, path: Path, seed: int, classes: ClassTable) -> SemGS:
    if name == "small":
        raise InputError(path, 'weights of "small", written by semgs', "another file")
    return from_mvsplat(untrained(networks.NETWORKS[name](), seed, classes), path, seed)


def semantic_tensors(model: SemGS) -> frozenset[str]:
    """Names of the tensors of a network's semantic branch."""
    return frozenset(name for name in model.state_dict() if name.startswith("semantic."))


def from_mvsplat(model: SemGS, path: Path, seed: int) -> SemGS:
    """A network that was drawn with this seed, its colour branch and depth filled from MVSplat's checkpoint.

    Raises:
        InputError: the file cannot be read or does not fit; the tensor is named.
    """
    tensors = mvsplat.read(path)
    own = model.state_dict()
    foreign = mvsplat.renamed(tensors, path)
    semantic = semantic_tensors(model)
    fresh = {key: value for key, value in own.items() if key not in foreign and key in semantic}
    fill(model, foreign | fresh, path, model.name)
    model.origin = f"{path.name}: all {len(foreign)} tensors of MVSplat taken" + (
        f"; {len(fresh)} tensors of the semantic branch drawn at random with seed {seed}" if fresh else ""
    )
    return model
