"""Models of transformers: tiny ones with random weights, compared with the sums written out."""

from __future__ import annotations

import json
import logging
import logging.handlers
import math
import re
import shutil
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny_models
import torch
from PIL import Image

from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.segmenters.huggingface import TEMPERATURE, ClipSeg, Pretrained, Words
from semgs.segmenters.opening import open_network, open_segmenter
from semgs.sources.transformers_models import licence_of

HALF = (0.5, 0.5, 0.5)
IMAGENET = ((0.485, 0.456, 0.406), (0.229, 0.224, 0.225))
PREPARED: dict[str, Any] = {
    "segformer": (32, 48, Image.Resampling.BILINEAR, *IMAGENET),
    "upernet": (32, 48, Image.Resampling.BILINEAR, *IMAGENET),
    "dpt": (32, 32, Image.Resampling.BICUBIC, HALF, HALF),
    "beit": (32, 32, Image.Resampling.BICUBIC, HALF, HALF),
    "maskformer": (32, 64, Image.Resampling.BILINEAR, *IMAGENET),
    "mask2former": (32, 64, Image.Resampling.BILINEAR, *IMAGENET),
    "oneformer": (32, 64, Image.Resampling.BILINEAR, *IMAGENET),
    "clipseg": (32, 32, Image.Resampling.BILINEAR, (0.48, 0.46, 0.41), (0.23, 0.22, 0.23)),
}
"""Height, width, resampling, mean and deviation of each kind's processor."""

Write = Callable[[str], tuple[Path, Any]]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Write:
    """Writes the model of a kind, once; gives the folder and the model."""
    made: dict[str, tuple[Path, Any]] = {}

    def write(kind: str) -> tuple[Path, Any]:
        if kind not in made:
            folder = tmp_path_factory.mktemp("models") / kind
            made[kind] = folder, tiny_models.write_model(folder, kind)
        return made[kind]

    return write


@pytest.fixture
def copied(written: Write, tmp_path: Path) -> Path:
    """A copy of a SegFormer, to be spoiled."""
    return shutil.copytree(written("segformer")[0], tmp_path / "model")


def photo() -> np.ndarray:
    """Blocks of random colours, 30x51."""
    blocks = np.random.default_rng(2).integers(0, 256, (6, 17, 3), dtype=np.uint8)
    return np.repeat(np.repeat(blocks, 5, axis=0), 3, axis=1)


def pixels(kind: str, image: np.ndarray) -> torch.Tensor:
    """The image as the model of a kind takes it, without its processor."""
    height, width, resampling, mean, deviation = PREPARED[kind]
    small = np.asarray(Image.fromarray(image).resize((width, height), resampling)) / 255
    return torch.from_numpy(((small - mean) / deviation).transpose(2, 0, 1)[None]).float()


def edited(path: Path, **changed: Any) -> None:
    """Change keys of a JSON file."""
    path.write_text(json.dumps(json.loads(path.read_text()) | changed))


@pytest.mark.parametrize("kind", ["segformer", "upernet", "dpt", "beit"])
def test_models_with_logits_give_their_softmax(written, kind):
    folder, model = written(kind)
    with torch.no_grad():
        logits = model(pixels(kind, photo())).logits[0].double().numpy()
    raised = np.exp(logits - logits.max(0))
    expected = raised / raised.sum(0)
    found = open_network(folder)(photo())
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, atol=2e-5)
    assert expected.std(axis=(1, 2)).max() > 1e-3


@pytest.mark.parametrize("kind", ["maskformer", "mask2former", "oneformer"])
def test_models_with_masks_give_the_sum_over_masks_divided_by_that_over_classes(written, kind):
    """score(class, pixel) = sum over masks of P(class | mask), without "no object", times the mask's sigmoid."""
    folder, model = written(kind)
    given = {"pixel_values": pixels(kind, photo())}
    if kind == "oneformer":
        words = ["the", "task", "is", "semantic"]
        letters = [place for word in words for place in [*(ord(one) - 97 for one in word[:-1]), ord(word[-1]) - 71]]
        given["task_inputs"] = torch.tensor([[52, *letters, 53, *[0] * (22 - len(letters))]])
    with torch.no_grad():
        answer = model(**given)
    masks = answer.masks_queries_logits
    if kind == "mask2former":
        masks = torch.nn.functional.interpolate(masks, size=(384, 384), mode="bilinear", align_corners=False)
    scores = torch.zeros(5, *masks.shape[-2:], dtype=torch.float64)
    for mask, classes in zip(masks[0].double(), answer.class_queries_logits[0].double(), strict=True):
        raised = classes.exp()
        for label in range(5):
            scores[label] += raised[label] / raised.sum() / (1 + (-mask).exp())
    expected = (scores / scores.sum(0)).numpy()
    np.testing.assert_allclose(open_network(folder)(photo()), expected, atol=2e-5)
    assert expected.std(axis=(1, 2)).max() > 1e-3


def test_words_and_none_of_these_share_a_softmax(written):
    folder, model = written("clipseg")
    words = ("Mug", "power socket", "chair")
    tokens = tiny_models.tokenizer()(list(words), padding=True, return_tensors="pt")
    with torch.no_grad():
        logits = model(pixel_values=pixels("clipseg", photo()).expand(3, -1, -1, -1), **tokens).logits.double().numpy()
    raised = np.exp(logits)
    assert TEMPERATURE == 1
    segmenter = open_network(folder, words)
    found = segmenter(photo())
    np.testing.assert_allclose(found[:3], raised / (1 + raised.sum(0)), atol=1e-4)
    np.testing.assert_allclose(found[3], 1 / (1 + raised.sum(0)), atol=1e-4)
    assert segmenter.classes.names == ("Mug", "power socket", "chair", "none of these")
    assert segmenter.classes.colours[2:] == (SCANNET20.colours[4], (205, 205, 205)), "a chair's, and grey"
    assert found.std(axis=(1, 2)).max() > 1e-2


def test_words_keep_their_own_table(written):
    opened = open_segmenter(written("clipseg")[0], words=["mug", "chair"])
    assert opened.classes.names == ("mug", "chair", "none of these")
    assert len(set(opened.classes.colours)) == 3


class Sure:
    """A text-prompted model that finds each word everywhere with these log-odds."""

    made_by = None

    def logits(self, image: np.ndarray, words: tuple[str, ...]) -> np.ndarray:
        return np.broadcast_to(np.array([0.0, math.log(2)], np.float32)[:, None, None], (2, 4, 6)).copy()


def test_other_text_prompted_models_can_be_used():
    """Odds of 1, 2 and, for none of these, 1."""
    found = Words(Sure(), ("mug", "chair"))(photo())
    np.testing.assert_allclose(found[:, 1, 2], [0.25, 0.5, 0.25], atol=1e-6)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("chair", " "), "expected words, found an empty one"),
        (("power socket", "mug", "Power  socket"), "expected different words, found 'power socket' twice"),
        (("mug", "none of these"), "expected different words, found 'none of these' twice"),
        ((), "expected 1 to 254 words, found 0"),
    ],
)
def test_words_that_make_no_table_are_refused(words, expected):
    with pytest.raises(ValueError, match=expected):
        Words(Sure(), words)


def test_words_are_for_text_prompted_models_and_these_need_them(written, tmp_path):
    with pytest.raises(
        InputError, match=r"clipseg: expected words, as clipseg has no classes of its own, found none; give --words"
    ):
        open_network(written("clipseg")[0])
    with pytest.raises(InputError, match="expected a text-prompted model for --words: clipseg, found segformer"):
        open_network(written("segformer")[0], ("chair",))
    with pytest.raises(InputError, match="expected a text-prompted model for --words, such as CLIPSeg"):
        open_network(tmp_path / "net.onnx", ("chair",))


def test_classes_are_the_models_own_or_scannets(written):
    folder, _ = written("segformer")
    assert open_segmenter(folder, "own").classes.names == tiny_models.NAMES
    assert open_segmenter(folder).classes.name == "scannet20"


def test_a_model_whose_class_names_say_nothing_is_refused_with_the_list(copied):
    edited(copied / "config.json", id2label={str(label): f"LABEL_{label}" for label in range(5)})
    with pytest.raises(InputError, match=r"5 of 5 class names are unknown \(LABEL_0, LABEL_1.*use --classes own"):
        open_segmenter(copied)


def test_the_record_names_folder_hashes_and_licence(copied):
    (copied / "README.md").write_text("---\ntags: [vision]\nlicense: apache-2.0\n---\n# A model\nlicense: mit\n")
    made_by = open_network(copied).made_by
    assert made_by.title == "model (licence apache-2.0)"
    assert [len(one) for one in made_by.digest.split()] == [64, 64, 64]


@pytest.mark.parametrize(
    ("readme", "licence"),
    [
        ("---\nlicense: [mit, apache-2.0]\n---\n", "mit, apache-2.0"),
        ("---\r\nlicense: other\r\nlicense_name: nvidia-source\r\n---\r\n", "nvidia-source"),
        ("---\nlicense: other\n---\n", "other"),
        ("---\ntags: [vision]\n---\nlicense: mit", "unknown"),
        ("---\nlicense: [mit\n---\n", "unknown"),
        ("# license: mit", "unknown"),
    ],
)
def test_the_licence_is_in_the_front_matter(tmp_path, readme, licence):
    (tmp_path / "README.md").write_text(readme)
    assert licence_of(tmp_path) == licence


def test_pickled_weights_are_refused_with_the_command_that_converts_them(copied):
    from safetensors.torch import load_file

    expected = open_network(copied)(photo())
    torch.save(load_file(copied / "model.safetensors"), copied / "pytorch_model.bin")
    (copied / "model.safetensors").unlink()
    with pytest.raises(
        InputError, match=r"model: expected weights in model\.safetensors, found pytorch_model\.bin"
    ) as caught:
        open_network(copied)
    command = re.search(r'python -c "(.*)"', str(caught.value))
    assert command is not None
    exec(command[1], {})
    np.testing.assert_array_equal(open_network(copied)(photo()), expected)


def test_weights_in_several_files_are_read(written, tmp_path):
    folder, model = written("segformer")
    shutil.copytree(folder, tmp_path / "model")
    (tmp_path / "model" / "model.safetensors").unlink()
    model.save_pretrained(tmp_path / "model", max_shard_size="100KB")
    assert len(list((tmp_path / "model").glob("*.safetensors"))) > 1
    np.testing.assert_array_equal(open_network(tmp_path / "model")(photo()), open_network(folder)(photo()))


def without_a_weight(folder: Path) -> None:
    from safetensors.torch import load_file, save_file

    weights = load_file(folder / "model.safetensors")
    del weights["decode_head.classifier.weight"]
    save_file(weights, folder / "model.safetensors", {"format": "pt"})


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        (lambda model: edited(model / "config.json", auto_map={"AutoModel": "code.Model"}), "config.json: auto_map: expected a model that needs no code of its own, which is never run"),
        (lambda model: edited(model / "config.json", model_type="bert"), "config.json: model_type: expected a segmenter: segformer, upernet"),
        (lambda model: edited(model / "config.json", architectures=["SegformerForImageClassification"]), "config.json: architectures: expected a segmenter: SegformerForSemanticSegmentation, found ['SegformerForImageClassification']"),
        (lambda model: edited(model / "config.json", id2label=dict.fromkeys("01234", "wall")), "config.json: id2label: expected a table of classes, found class table model has a class name twice"),
        (lambda model: edited(model / "config.json", decoder_hidden_size=24), ": expected decode_head.batch_norm.bias of 24, as config.json says, found 16"),
        (lambda model: edited(model / "preprocessor_config.json", do_center_crop=True), ": expected a processor of images that keeps the whole image, found do_center_crop"),
        (lambda model: (model / "config.json").write_text("{"), "config.json: expected the configuration of a model"),
        (lambda model: (model / "config.json").write_text("[]"), "config.json: expected an object, found []"),
        (lambda model: (model / "preprocessor_config.json").unlink(), ": expected a processor of images, found"),
        (lambda model: (model / "model.safetensors").unlink(), ": expected weights in model.safetensors, found none; download them"),
        (lambda model: (model / "model.safetensors").write_bytes(b"1234567890"), ": expected SegformerForSemanticSegmentation, found"),
        (without_a_weight, ": expected all weights of SegformerForSemanticSegmentation, found none for decode_head.classifier.weight"),
    ],
)  # fmt: skip
def test_what_is_no_segmenter_or_damaged_is_refused(copied, spoil, expected):
    spoil(copied)
    with pytest.raises(InputError, match=re.escape(expected)) as caught:
        open_network(copied)
    assert str(caught.value).startswith(str(copied))
    assert "\n" not in str(caught.value)


def test_a_list_of_weights_outside_the_folder_is_refused(copied):
    (copied / "model.safetensors").unlink()
    (copied / "model.safetensors.index.json").write_text('{"weight_map": {"a": "../other.safetensors"}}')
    with pytest.raises(InputError, match="weight_map: expected the names of safetensors files"):
        open_network(copied)


def test_an_image_that_the_model_cannot_take_is_refused(written):
    segmenter = open_network(written("segformer")[0])
    assert isinstance(segmenter, Pretrained)
    segmenter.processor.do_resize = False
    with pytest.raises(
        InputError, match=r"segformer: expected a model that can take an image of 1x2 \(height x width\)"
    ):
        segmenter(np.zeros((1, 2, 3), np.uint8))


def test_words_that_the_model_cannot_take_are_refused(written):
    segmenter = open_network(written("clipseg")[0], ("a word longer than the model can read",))
    assert isinstance(segmenter, Words)
    assert isinstance(segmenter.model, ClipSeg)
    with pytest.raises(InputError, match=r"clipseg: expected a model that can take an image of 30x51"):
        segmenter(photo())


def test_a_missing_library_is_named_with_its_extra(copied, monkeypatch):
    monkeypatch.setitem(sys.modules, "transformers", None)
    with pytest.raises(ImportError, match=r"pip install -e '\.\[segment\]'"):
        open_network(copied)


@pytest.fixture
def offline(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """No network; the empty cache of the hub."""
    from huggingface_hub import constants

    monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
    monkeypatch.setattr(constants, "HF_HUB_CACHE", str(tmp_path / "hub"))
    return tmp_path / "hub"


def test_without_a_network_the_error_says_what_to_fetch_by_hand(offline):
    with pytest.raises(InputError, match=r"hf:owner/name: expected a model that can be downloaded, found .*https://huggingface.co/owner/name by other means and name its folder"):  # fmt: skip
        open_network("hf:owner/name")


def test_retries_of_the_download_are_not_shown(monkeypatch: pytest.MonkeyPatch):
    """The library of the hub retries for half a minute without a network, and warns each time."""
    import transformers

    log, shown = logging.getLogger("huggingface_hub.utils._http"), logging.handlers.BufferingHandler(9)
    monkeypatch.setattr(log, "handlers", [shown])

    def failing(*_: object, **__: object) -> str:
        log.warning("Retrying in 1s")
        raise OSError("no connection")

    monkeypatch.setattr(transformers.utils, "cached_file", failing)
    with pytest.raises(InputError, match="found no connection"):
        open_network("hf:owner/name")
    assert shown.buffer == []
    log.warning("later")
    assert [record.getMessage() for record in shown.buffer] == ["later"]


@pytest.mark.parametrize("name", ["hf:name", "hf:owner/name/more", "hf:owner/name@", "hf:../name", "hf:"])
def test_other_names_of_the_hub_are_refused(name):
    with pytest.raises(InputError, match="expected hf:OWNER/NAME, optionally followed by @REVISION"):
        open_network(name)


@pytest.mark.parametrize("name", ["hf:owner/tiny", "hf://owner/tiny", "hf:owner/tiny@v1"])
def test_a_model_in_the_cache_of_the_hub_needs_no_network(offline, written, name):
    commit = "0123456789abcdef0123456789abcdef01234567"
    folder, _ = written("segformer")
    cached = offline / "models--owner--tiny"
    shutil.copytree(folder, cached / "snapshots" / commit)
    (cached / "refs").mkdir()
    for revision in ("main", "v1"):
        (cached / "refs" / revision).write_text(commit)
    segmenter = open_network(name)
    assert segmenter.made_by.name == name
    assert segmenter.made_by.pinned == f"{name.removesuffix('@v1')}@{commit}"
    assert segmenter.made_by == replace(segmenter.made_by, revision="")
    assert open_network(folder).made_by.pinned == folder.name
    np.testing.assert_array_equal(segmenter(photo()), open_network(folder)(photo()))
