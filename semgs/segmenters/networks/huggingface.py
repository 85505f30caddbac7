"""Segmentation models in the format of Hugging Face's transformers: from a local folder, or from the hub as hf:OWNER/NAME[@REVISION].

A model of the hub is downloaded to the cache of transformers and then opened as a local folder. Weights are read from safetensors files only, and
code that comes with a model is never run.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, final

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.files.errors import InputError, input_error
from semgs.files.extras import needs_extra
from semgs.files.hashes import sha256
from semgs.files.paths import typed_path
from semgs.files.strict_json import read_json
from semgs.files.text import listed
from semgs.segmenters.class_map_files import MadeBy
from semgs.segmenters.networks.network_source import Segmenter
from semgs.segmenters.networks.words import Words
from semgs.segmenters.tables import make_class_table

SCHEME = "hf:"
CONFIG = "config.json"
WEIGHTS = "model.safetensors"
INDEX = "model.safetensors.index.json"

LOGITS = {
    "segformer": "SegformerForSemanticSegmentation",
    "upernet": "UperNetForSemanticSegmentation",
    "dpt": "DPTForSemanticSegmentation",
    "beit": "BeitForSemanticSegmentation",
}
"""Models that give each pixel logits, by their type in `config.json`."""

MASKS = {
    "maskformer": "MaskFormerForInstanceSegmentation",
    "mask2former": "Mask2FormerForUniversalSegmentation",
    "oneformer": "OneFormerForUniversalSegmentation",
}
"""Models that give masks with classes; a pixel's score of a class is the sum over the masks, not yet divided by that over the classes."""

PROMPTED = {"clipseg": "CLIPSegForImageSegmentation"}
"""Models that words describe the classes of."""

PROCESSORS = ("preprocessor_config.json", "processor_config.json")
"""Files that say how images are prepared."""

OTHER_FILES = (
    *PROCESSORS, "tokenizer.json", "tokenizer_config.json", "special_tokens_map.json",
    "vocab.json", "merges.txt", "README.md",
)  # fmt: skip
"""What else is downloaded of a model, as far as it has it."""

KNOWN = LOGITS | MASKS | PROMPTED

CONVERT = (
    'convert its pickled weights, if you trust them: python -c "from transformers import {model} as M; '
    "M.from_pretrained('{folder}', use_safetensors=False).save_pretrained('{folder}')\""
)
"""The command that turns weights in `.bin` files into safetensors, in the same folder."""


@final
@dataclass(frozen=True)
class Pretrained:
    """A segmentation model with its processor; a `Segmenter`.

    Attributes:
        folder: of the model.
        model: in evaluation mode, on the CPU.
        processor: prepares images, and turns what the model gives into scores.
        masks: whether scores are sums over masks; otherwise logits.
        classes: the model's own table.
        made_by: which model it is.
        options: what the processor takes beside an image.
    """

    folder: Path
    model: Any
    processor: Any
    masks: bool
    classes: ClassTable
    made_by: MadeBy
    options: Mapping[str, Any] = field(default_factory=dict)

    def __call__(self, image: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "class rows columns"]:
        """The distribution over the classes, at the model's own resolution.

        Args:
            image: RGB.

        Raises:
            InputError: the model cannot take the image, or gives something else than its classes.
        """
        with _runs(self.folder, image):
            inputs = _prepared(self.processor, image, self.options)
            found = self.processor.post_process_semantic_segmentation(
                self.model(**inputs), return_segmentation_scores=True
            )
        scores = found[0].segmentation_scores.float()
        if len(scores) != len(self.classes) or not scores.isfinite().all():
            raise InputError(self.folder, f"finite scores of {len(self.classes)} classes", f"shape {[*scores.shape]}")
        return (_shares(scores) if self.masks else scores.softmax(0)).numpy()


@final
@dataclass(frozen=True)
class ClipSeg:
    """CLIPSeg, which finds what words describe; `Prompted`.

    Attributes:
        folder: of the model.
        model: in evaluation mode, on the CPU.
        processor: prepares images and words.
        made_by: which model it is.
    """

    folder: Path
    model: Any
    processor: Any
    made_by: MadeBy

    def logits(
        self, image: UInt8[np.ndarray, "h w 3"], words: tuple[str, ...]
    ) -> Float32[np.ndarray, "word rows columns"]:
        """For each word the log-odds that a pixel shows it, at the model's own resolution.

        Args:
            image: RGB.
            words: a word or phrase each.

        Raises:
            InputError: the model cannot take the image or the words.
        """
        with _runs(self.folder, image):
            pixels = _prepared(self.processor.image_processor, image, {})["pixel_values"]
            tokens = self.processor.tokenizer(list(words), padding=True, return_tensors="pt")
            meanings = self.model.get_conditional_embeddings(
                batch_size=len(words), input_ids=tokens["input_ids"], attention_mask=tokens["attention_mask"]
            )
            maps = [
                self.model(pixel_values=pixels, conditional_embeddings=meaning[None]).logits for meaning in meanings
            ]
        return torch.stack([one.reshape(one.shape[-2:]) for one in maps]).float().numpy()


def is_model(name: str) -> bool:
    """Whether a name is that of a model: of the hub, or of a folder with one."""
    return name.startswith(SCHEME) or (typed_path(name) / CONFIG).is_file()


def open_transformers_model(name: str, words: tuple[str, ...] = ()) -> Segmenter:
    """Open a model; downloads it if it is on the hub and not in the cache.

    Args:
        name: a folder, or hf:OWNER/NAME[@REVISION].
        words: the classes, for a text-prompted model; () for others.

    Raises:
        InputError: it cannot be read or downloaded, is no segmenter of a known kind, would run its own code, or has no safetensors
            weights; or words are missing, or given to a model with classes of its own.
        ImportError: transformers is not installed; the message names the extra.
        ValueError: the words make no table.
    """
    with needs_extra("segment", f"{name} is a model of transformers", "transformers"):
        import transformers
    with _quiet(transformers):
        folder = _downloaded(name, transformers) if name.startswith(SCHEME) else typed_path(name)
        kind = _kind(folder)
        _check_words(name, kind, words)
        weights = _weights(folder, KNOWN[kind])
        with _loads(folder, KNOWN[kind]):
            model, report = getattr(transformers, KNOWN[kind]).from_pretrained(
                folder,
                use_safetensors=True,
                trust_remote_code=False,
                local_files_only=True,
                output_loading_info=True,
                ignore_mismatched_sizes=True,  # they are refused by name below
                dtype=torch.float32,
            )
        if report["missing_keys"]:
            raise InputError(
                folder, f"all weights of {KNOWN[kind]}", f"none for {listed(sorted(report['missing_keys']), 3)}"
            )
        if report["mismatched_keys"]:
            name, found, expected = min(report["mismatched_keys"])
            shapes = [" x ".join(map(str, shape)) for shape in (expected, found)]
            raise InputError(folder, f"{name} of {shapes[0]}, as {CONFIG} says", shapes[1])
        with _loads(folder, "a processor of images"):
            processor = _processor(folder, kind, model.config, transformers)
    if fault := _fault(processor):
        raise InputError(folder, "a processor of images that keeps the whole image", fault)
    shown = name if name.startswith(SCHEME) else folder.absolute().name
    settings = (folder / file for file in (CONFIG, *PROCESSORS))
    digest = " ".join(sha256(path) for path in (*weights, *settings) if path.is_file())
    made_by, model = MadeBy(shown, digest, licence_of(folder)), model.eval().requires_grad_(False)
    if kind in PROMPTED:
        return Words(ClipSeg(folder, model, processor, made_by), words)
    labels = model.config.id2label
    with input_error(folder / CONFIG, "a table of classes", key="id2label"):
        classes = make_class_table(shown, [str(labels[label]) for label in sorted(labels)])
    options = {"task_inputs": ["semantic"]} if kind == "oneformer" else {}
    return Pretrained(folder, model, processor, kind in MASKS, classes, made_by, options)


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


def _downloaded(name: str, transformers: Any) -> Path:
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
        advice = f"download https://huggingface.co/{repository} by other means and name its folder: --segmenter FOLDER"
        raise InputError(name, "a model that can be downloaded", _first_line(error), advice=advice) from None
    return folder


def _kind(folder: Path) -> str:
    """The type of the model in a folder.

    Raises:
        InputError: it is not one of those known here, or brings its own code.
    """
    path = folder / CONFIG
    config: Any = read_json(path, "the configuration of a model")
    if not isinstance(config, dict):
        raise InputError(path, "an object", f"{config!r:.60}")
    if "auto_map" in config:
        raise InputError(path, "a model that needs no code of its own, which is never run", "some", key="auto_map")
    kind, built = config.get("model_type"), config.get("architectures")
    if not isinstance(kind, str) or kind not in KNOWN:
        raise InputError(path, f"a segmenter: {', '.join(KNOWN)}", f"{kind!r:.60}", key="model_type")
    if not isinstance(built, list) or KNOWN[kind] not in built:
        raise InputError(path, f"a segmenter: {KNOWN[kind]}", f"{built!r:.60}", key="architectures")
    return kind


def _check_words(name: str, kind: str, words: tuple[str, ...]) -> None:
    """Refuse words for a model with classes of its own, and a text-prompted model without words.

    Raises:
        InputError: as above.
    """
    if kind in PROMPTED and not words:
        raise InputError(
            name, f"words, as {kind} has no classes of its own", "none", advice="give --words chair table ..."
        )
    if words and kind not in PROMPTED:
        found = f"{kind}, which has its own classes"
        raise InputError(name, f"a text-prompted model for --words: {', '.join(PROMPTED)}", found)


def _weights(folder: Path, model: str) -> list[Path]:
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


def _processor(folder: Path, kind: str, config: Any, transformers: Any) -> Any:
    """What prepares images for a model; for some kinds with a tokenizer."""
    local = {"trust_remote_code": False, "local_files_only": True}
    if kind not in ("oneformer", "clipseg"):
        return transformers.AutoImageProcessor.from_pretrained(folder, **local)
    tokenizer = transformers.AutoTokenizer.from_pretrained(folder, **local)
    if kind == "clipseg":
        return transformers.CLIPSegProcessor(
            transformers.AutoImageProcessor.from_pretrained(folder, **local), tokenizer
        )
    # The names of classes, which would be downloaded, are only for training.
    images = transformers.AutoImageProcessor.from_pretrained(folder, class_info_file=None, **local)
    return transformers.OneFormerProcessor(images, tokenizer, task_seq_length=config.task_seq_len)


def _shares(scores: Float[Tensor, "class rows columns"]) -> Float32[Tensor, "class rows columns"]:
    """Scores divided by their sum over the classes, however small that is; even where it is 0."""
    total = scores.double().sum(0)
    return torch.where(total > 0, scores / total.where(total > 0, 1.0), 1 / len(scores)).float()


def _fault(processor: Any) -> str | None:
    """Why what a model says would not cover the whole image; None if it would."""
    images = getattr(processor, "image_processor", processor)
    if getattr(images, "do_center_crop", False):
        return "do_center_crop"
    if getattr(images, "pad_size", None) is not None:
        return "pad_size"
    return "do_pad" if getattr(images, "do_pad", False) and "DPT" in type(images).__name__ else None


def _prepared(processor: Any, image: UInt8[np.ndarray, "h w 3"], options: Mapping[str, Any]) -> Any:
    """An image as a model takes it."""
    return processor(images=image, return_tensors="pt", input_data_format="channels_last", **options)


@contextmanager
def _runs(folder: Path, image: np.ndarray) -> Iterator[None]:
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
def _loads(folder: Path, expected: str) -> Iterator[None]:
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
def _quiet(transformers: Any) -> Iterator[None]:
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
