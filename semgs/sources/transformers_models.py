"""Models in the format of Hugging Face's transformers: from a local folder, or from the hub as hf:OWNER/NAME[@REVISION].

A model of the hub is downloaded to the cache of transformers and then opened as a local folder. Weights are read from safetensors files only, and
code that comes with a model is never run.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import UInt8

from semgs.files.contents import sha256
from semgs.files.errors import InputError, needs_extra
from semgs.files.paths import typed_path
from semgs.files.strict_json import read_json
from semgs.files.text import listed
from semgs.sources.source import MadeBy

SCHEME = "hf:"
CONFIG = "config.json"
WEIGHTS = "model.safetensors"
INDEX = "model.safetensors.index.json"

PROCESSORS = ("preprocessor_config.json", "processor_config.json")
"""Files that say how images are prepared."""

LOCAL = {"trust_remote_code": False, "local_files_only": True}
"""How whatever is in a folder is opened."""

OTHER_FILES = (
    *PROCESSORS, "tokenizer.json", "tokenizer_config.json", "special_tokens_map.json",
    "vocab.json", "merges.txt", "README.md",
)  # fmt: skip
"""What else is downloaded of a model, as far as it has it."""

CONVERT = (
    'convert its pickled weights, if you trust them: python -c "from transformers import {model} as M; '
    "M.from_pretrained('{folder}', use_safetensors=False).save_pretrained('{folder}')\""
)
"""The command that turns weights in `.bin` files into safetensors, in the same folder."""


def is_model(name: str) -> bool:
    """Whether a name is that of a model: of the hub, or of a folder with one."""
    return name.startswith(SCHEME) or (typed_path(name) / CONFIG).is_file()


def licence_of(folder: Path) -> str:
    """The licence in the front matter of a model's README; "unknown" if it does not say."""
    import yaml

    readme = folder / "README.md"
    text = readme.read_text(encoding="utf-8", errors="replace") if readme.is_file() else ""
    head = re.match(r"\ufeff?---[ \t]*\r?\n(.*?)\r?\n---", text, re.DOTALL)
    try:
        found = yaml.safe_load(head[1]) if head else None
    except yaml.YAMLError:
        found = None
    stated = found.get("license") if isinstance(found, dict) else None
    names = [str(one) for one in (stated if isinstance(stated, list) else [stated]) if one]
    if isinstance(found, dict) and names == ["other"] and found.get("license_name"):
        names = [str(found["license_name"])]
    return ", ".join(names) or "unknown"


def _download(name: str, transformers: Any) -> Path:
    """The folder of a model of the hub, in the cache of transformers.

    Raises:
        InputError: the name has another form, or the model can neither be downloaded nor found in the cache.
    """
    word = r"\w[\w.-]*"
    match = re.fullmatch(rf"{SCHEME}(?://)?({word}/{word})(?:@([\w./-]+))?", name)
    if match is None:
        raise InputError(name, f"{SCHEME}OWNER/NAME, optionally followed by @REVISION", "something else")
    repository, fetch = match[1], transformers.utils.cached_file
    try:
        folder = Path(fetch(repository, CONFIG, revision=match[2])).parent
        commit = folder.name  # the branch may move meanwhile
        for file in OTHER_FILES:
            with suppress(OSError):
                fetch(repository, file, revision=commit)
        with suppress(OSError):
            fetch(repository, WEIGHTS, revision=commit)
            return folder
        with suppress(OSError):
            fetch(repository, INDEX, revision=commit)
            for path in _shards(folder):
                fetch(repository, path.name, revision=commit)
    except InputError:
        raise
    except Exception as error:  # the library passes on errors of its HTTP client, which changes between versions
        advice = f"download https://huggingface.co/{repository} by other means and name its folder"
        raise InputError(name, "a model that can be downloaded", _first_line(error), advice=advice) from None
    return folder


@dataclass(frozen=True)
class ModelFolder:
    """A folder with a model of a known kind.

    Attributes:
        name: as the user gave it.
        path: the folder.
        kind: its type in `config.json`.
        architecture: of its weights.
        config: its configuration.
        transformers: the library.
    """

    name: str
    path: Path
    kind: str
    architecture: str
    config: dict[str, Any]
    transformers: Any

    def load(self, processor_of: Callable[[Any], Any], *, whole: bool = True) -> tuple[Any, Any, MadeBy]:
        """The model with all its weights, its processor of images, and which model it is.

        The model is in evaluation mode, in float32 on the CPU, without gradients. Code that comes with it is not run.

        Args:
            processor_of: opens the processor, given the configuration of the model.
            whole: whether to refuse processors that cut or pad images.

        Raises:
            InputError: the folder has no safetensors weights, they are not those of the architecture, or the processor cannot be used.
        """
        weights = _find_weights(self.path, self.architecture)
        with quiet(self.transformers):
            with loads(self.path, self.architecture):
                model, report = getattr(self.transformers, self.architecture).from_pretrained(
                    self.path,
                    **LOCAL,
                    use_safetensors=True,
                    output_loading_info=True,
                    ignore_mismatched_sizes=True,  # they are refused by name below
                    dtype=torch.float32,
                )
            if report["missing_keys"]:
                missing = listed(sorted(report["missing_keys"]), 3)
                raise InputError(self.path, f"all weights of {self.architecture}", f"none for {missing}")
            if report["mismatched_keys"]:
                name, found, expected = min(report["mismatched_keys"])
                shapes = [" x ".join(map(str, shape)) for shape in (expected, found)]
                raise InputError(self.path, f"{name} of {shapes[0]}, as {CONFIG} says", shapes[1])
            with loads(self.path, "a processor of images"):
                processor = processor_of(model.config)
        if whole and (fault := _find_fault(processor)):
            raise InputError(self.path, "a processor of images that keeps the whole image", fault)
        settings = (self.path / file for file in (CONFIG, *PROCESSORS))
        digest = " ".join(sha256(path) for path in (*weights, *settings) if path.is_file())
        of_hub = self.name.startswith(SCHEME)
        commit = self.path.name if of_hub and re.fullmatch("[0-9a-f]{40}", self.path.name) else ""
        made_by = MadeBy(self.name if of_hub else self.path.absolute().name, digest, licence_of(self.path), commit)
        return model.eval().requires_grad_(False), processor, made_by


def find_model(name: str, known: Mapping[str, str], what: str) -> ModelFolder:
    """The folder of a model; downloads it if it is on the hub and not in the cache.

    Args:
        name: a folder, or hf:OWNER/NAME[@REVISION].
        known: architectures by type.
        what: they are, for the error.

    Raises:
        InputError: it cannot be read or downloaded, is not one of those known here, or brings its own code.
        ImportError: transformers is not installed; the message names the extra.
    """
    with needs_extra("segment", f"{name} is a model of transformers", "transformers"):
        import transformers
    with quiet(transformers):
        folder = _download(name, transformers) if name.startswith(SCHEME) else typed_path(name)
    path = folder / CONFIG
    config: Any = read_json(path, "the configuration of a model")
    if not isinstance(config, dict):
        raise InputError(path, "an object", f"{config!r:.60}")
    if "auto_map" in config:
        raise InputError(path, "a model that needs no code of its own, which is never run", "some", key="auto_map")
    kind, built = config.get("model_type"), config.get("architectures")
    if not isinstance(kind, str) or kind not in known:
        raise InputError(path, f"{what}: {', '.join(known)}", f"{kind!r:.60}", key="model_type")
    if not isinstance(built, list) or known[kind] not in built:
        raise InputError(path, f"{what}: {known[kind]}", f"{built!r:.60}", key="architectures")
    return ModelFolder(name, folder, kind, known[kind], config, transformers)


def _find_weights(folder: Path, model: str) -> list[Path]:
    """The files with a model's weights.

    Raises:
        InputError: there are none in safetensors, or the list of them is damaged.
    """
    if (folder / WEIGHTS).is_file():
        return [folder / WEIGHTS]
    if (folder / INDEX).is_file():
        return _shards(folder)
    pickled = sorted(folder.glob("*.bin"))
    if pickled:
        advice = CONVERT.format(model=model, folder=folder)
        raise InputError(folder, f"weights in {WEIGHTS}", pickled[0].name, advice=advice)
    advice = f"download them, or a {model} that has them"
    raise InputError(folder, f"weights in {WEIGHTS}", "none", advice=advice)


def _shards(folder: Path) -> list[Path]:
    """The files that the list of weights in a folder names.

    Raises:
        InputError: it is damaged.
    """
    found: Any = read_json(folder / INDEX, "a list of weights")
    named = found.get("weight_map") if isinstance(found, dict) else None
    files = set(named.values()) if isinstance(named, dict) else set()
    if not files or not all(isinstance(file, str) and re.fullmatch(r"[\w.-]+\.safetensors", file) for file in files):
        raise InputError(folder / INDEX, "the names of safetensors files", f"{named!r:.60}", key="weight_map")
    return [folder / file for file in sorted(files)]


def prepare_image(processor: Any, image: UInt8[np.ndarray, "h w 3"], options: Mapping[str, Any]) -> Any:
    """An image as a model takes it."""
    return processor(images=image, return_tensors="pt", input_data_format="channels_last", **options)


@contextmanager
def runs(folder: Path, image: np.ndarray) -> Iterator[None]:
    """Run a model on an image without gradients; turn its errors into one line.

    Raises:
        InputError: in place of an error of the model.
    """
    height, width = image.shape[:2]
    try:
        with torch.inference_mode():
            yield
    except (ValueError, RuntimeError, IndexError, TypeError, AttributeError) as error:
        expected = f"a model that can take an image of {height}x{width} (height x width)"
        raise InputError(folder, expected, _first_line(error)) from error


@contextmanager
def loads(folder: Path, expected: str) -> Iterator[None]:
    """Turn errors while a model is loaded into one line.

    Raises:
        InputError: in place of any error but a lack of memory.
    """
    try:
        yield
    except MemoryError:
        raise
    except Exception as error:  # whatever the configuration makes the library do
        raise InputError(folder, expected, _first_line(error)) from error


@contextmanager
def quiet(transformers: Any) -> Iterator[None]:
    """Without progress bars and warnings of transformers, or of the hub's library, which reports each of its retries."""
    log, hub = transformers.utils.logging, logging.getLogger("huggingface_hub")
    level, bars, of_hub = log.get_verbosity(), log.is_progress_bar_enabled(), hub.level
    log.set_verbosity_error()
    log.disable_progress_bar()
    hub.setLevel(logging.ERROR)
    try:
        yield
    finally:
        hub.setLevel(of_hub)
        log.set_verbosity(level)
        if bars:
            log.enable_progress_bar()


def _first_line(error: Exception) -> str:
    """The first line of an error."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def _find_fault(processor: Any) -> str | None:
    """Why what a model says would not cover the whole image; None if it would."""
    images = getattr(processor, "image_processor", processor)
    if getattr(images, "do_center_crop", False):
        return "do_center_crop"
    if getattr(images, "pad_size", None) is not None:
        return "pad_size"
    return "do_pad" if getattr(images, "do_pad", False) and "DPT" in type(images).__name__ else None
