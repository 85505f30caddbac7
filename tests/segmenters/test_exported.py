"""Exported networks: small ones that multiply each pixel with a matrix, in both formats."""

from __future__ import annotations

import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import litert_writer
import numpy as np
import onnx_writer
import pytest
import torch

from semgs.files.errors import InputError
from semgs.segmenters.exported import Exported, open_exported, read_segmenter
from semgs.segmenters.opening import open_network

WEIGHT = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, -1, 0.25]])
BIAS = np.array([0.0, 0, 0, 0.1])
NAMES = ["wall", "floor", "chair", "lamp"]
SIZE = (4, 6)
DESCRIBED: dict[str, Any] = {
    "size": list(SIZE),
    "scaling": {"mean": [0.2, 0.2, 0.6], "std": [0.4, 0.4, 0.2]},
    "layout": "NCHW",
    "dtype": "float32",
    "classes": NAMES,
    "output": "logits",
}


def onnx(
    folder: Path, *, output: str = "logits", kind: str = "float32", dtype: str = "float32", **changed: Any
) -> Path:
    """An ONNX file of any size with its description."""
    path = folder / "net.onnx"
    sides = ("height", "width") if changed.get("size") == "any" else SIZE
    onnx_writer.write_pixelwise(path, WEIGHT, BIAS, shape=(1, 3, *sides), outputs={output: kind}, dtype=dtype)
    return described(path, dtype=dtype, **changed)


def litert(folder: Path, **changed: Any) -> Path:
    """A LiteRT file with its description."""
    path = litert_writer.write_pixelwise(folder / "net.tflite", WEIGHT, BIAS, SIZE)
    return described(path, layout="NHWC", **changed)


def described(path: Path, **changed: Any) -> Path:
    """The path of a network, whose description is written; None removes a key."""
    content = {key: value for key, value in (DESCRIBED | changed).items() if value is not None}
    path.with_suffix(".json").write_text(json.dumps(content))
    return path


def photo(height: int = SIZE[0], width: int = SIZE[1]) -> np.ndarray:
    """A photo of random colours."""
    return np.random.default_rng(5).integers(0, 256, (height, width, 3), dtype=np.uint8)


def by_hand(image: np.ndarray) -> np.ndarray:
    """The distribution of each pixel, in double precision."""
    values = (image / 255 - np.array([0.2, 0.2, 0.6])) / np.array([0.4, 0.4, 0.2])
    raised = np.exp(values @ WEIGHT.T + BIAS)
    return (raised / raised.sum(-1, keepdims=True)).transpose(2, 0, 1)


def test_logits_become_probabilities_by_softmax(tmp_path):
    """Red 51, green 153, blue 255 are 0, 1 and 2 after scaling; the fourth logit is -1 + 0.5 + 0.1 = -0.4."""
    segmenter = open_network(onnx(tmp_path))
    found = segmenter(np.broadcast_to(np.array([51, 153, 255], np.uint8), (*SIZE, 3)))
    raised = [1, math.e, math.e**2, math.exp(-0.4)]
    assert found.shape == (4, *SIZE)
    np.testing.assert_allclose(found[:, 2, 3], [one / sum(raised) for one in raised], atol=1e-6)
    assert segmenter.classes.names == tuple(NAMES)


@pytest.mark.parametrize("write", [onnx, litert])
def test_both_formats_and_layouts_give_what_double_precision_gives(tmp_path, write):
    changed = {"tensor": "inner/logits"} if write is litert else {}
    found = open_exported(write(tmp_path, **changed))(photo())
    np.testing.assert_allclose(found, by_hand(photo()), atol=2e-6)


def test_a_network_for_any_size_gets_the_photo_at_its_own(tmp_path):
    found = open_exported(onnx(tmp_path, size="any"))(photo(5, 11))
    np.testing.assert_allclose(found, by_hand(photo(5, 11)), atol=2e-6)


def test_a_larger_photo_is_averaged_by_area(tmp_path):
    """Each pixel becomes four: 9 more, 7 less, 7 more and 9 less."""
    small = photo().clip(9, 246)
    around = np.tile(np.array([[9, -7], [7, -9]]), SIZE)[..., None]
    image = (np.repeat(np.repeat(small, 2, axis=0), 2, axis=1) + around).astype(np.uint8)
    np.testing.assert_allclose(open_exported(onnx(tmp_path))(image), by_hand(small), atol=2e-6)


def test_offset_and_scale_are_of_pixels_and_integers_are_rounded_and_clipped(tmp_path):
    """(pixel - 10) / 2 as uint8: 5 becomes 0, 15 becomes 2 (2.5 to even), 255 becomes 122; the last logit is then -2 + 30.5 + 0.1."""
    path = onnx(tmp_path, dtype="uint8", scaling={"offset": 10, "scale": 2}, output="logits")
    values = open_exported(path).description.input.input_of(
        np.array([[[5, 15, 255]]], np.uint8).repeat(4, 0).repeat(6, 1)
    )
    assert values.dtype == np.uint8
    assert values[0, :, 1, 2].tolist() == [0, 2, 122]
    found = open_exported(path)(np.full((*SIZE, 3), (5, 15, 255), np.uint8))
    assert found[2].min() > 1 - 1e-6


def test_class_numbers_become_certain_answers(tmp_path):
    for path in (
        onnx(tmp_path, output="numbers", kind="int64", **{"size": "any"}),
        litert(tmp_path),
    ):
        described(path, output="class numbers", **({"layout": "NHWC"} if path.suffix == ".tflite" else {"size": "any"}))
        found = open_exported(path)(photo())
        assert set(np.unique(found)) == {0.0, 1.0}
        np.testing.assert_array_equal(found.argmax(0), by_hand(photo()).argmax(0))


@pytest.mark.parametrize("layout", ["NCHW", "NHWC"])
@pytest.mark.parametrize("output", ["logits", "probabilities", "class numbers"])
def test_an_output_in_the_other_layout_than_the_input_is_recognised(tmp_path, layout, output):
    """Of four classes and 5 x 6 pixels."""
    described(tmp_path / "net.onnx", layout=layout, output=output)
    description = read_segmenter(tmp_path / "net.json")
    expected = by_hand(photo(5, 6))
    values = np.log(expected) if output == "logits" else expected
    if output == "class numbers":
        values = expected.argmax(0)[None]
        expected = np.equal(values, np.arange(4)[:, None, None])
    for stored in (values[None], values.transpose(1, 2, 0)[None]):
        np.testing.assert_allclose(description.distribution_of(stored), expected, atol=1e-6)


@pytest.mark.parametrize("layout", ["NCHW", "NHWC"])
def test_an_output_that_fits_both_layouts_has_that_of_the_input(tmp_path, layout):
    """4 classes and 4 columns or rows: only along the axis of the layout do the numbers add up to 1."""
    described(tmp_path / "net.onnx", layout=layout, output="probabilities")
    certain = np.zeros((4, 5, 4), np.float32)
    certain[2] = 1
    stored = certain if layout == "NCHW" else certain.transpose(2, 1, 0)
    found = read_segmenter(tmp_path / "net.json").distribution_of(stored[None])
    np.testing.assert_array_equal(found, certain if layout == "NCHW" else certain.transpose(0, 2, 1))


def test_probabilities_are_taken_as_they_are(tmp_path):
    path = described(onnx(tmp_path, output="probabilities"), output="probabilities")
    np.testing.assert_allclose(open_exported(path)(photo()), by_hand(photo()), atol=2e-6)


def test_quantised_logits_are_converted_with_the_scale_and_zero_point_of_the_file(tmp_path):
    """Steps of 0.25 around 100: the logits of the first pixel, rounded to quarters."""
    path = litert_writer.write_pixelwise(tmp_path / "net.tflite", WEIGHT, BIAS, SIZE, quantised=(0.25, 100))
    segmenter = open_exported(described(path, layout="NHWC"))
    values = (photo() / 255 - np.array([0.2, 0.2, 0.6])) / np.array([0.4, 0.4, 0.2]) @ WEIGHT.T + BIAS
    rounded = np.round(values * 4) / 4
    np.testing.assert_allclose(segmenter.network(segmenter.description.input.input_of(photo()))[0], rounded, atol=1e-6)
    expected = torch.from_numpy(rounded).softmax(-1).permute(2, 0, 1)
    np.testing.assert_allclose(segmenter(photo()), expected, atol=1e-6)


def test_the_record_names_file_hashes_and_licence(tmp_path):
    path = onnx(tmp_path, licence="MIT")
    made_by = open_exported(path).made_by
    assert made_by.title == "net.onnx (licence MIT)"
    assert [len(one) for one in made_by.digest.split()] == [64, 64]
    described(path, scaling={"offset": 0, "scale": 255})
    other = open_exported(path).made_by
    assert other.digest.split()[0] == made_by.digest.split()[0]
    assert other.digest.split()[1] != made_by.digest.split()[1]
    assert other.licence == "unknown"


def test_the_descriptions_in_the_docs_are_valid(tmp_path):
    page = (Path(__file__).parents[2] / "docs/segmenters.md").read_text()
    found = re.findall(r'^ *\{"size".*?\}$', page, re.DOTALL | re.MULTILINE)
    counts = []
    for number, text in enumerate(found):
        (path := tmp_path / f"{number}.json").write_text(text)
        counts.append(len(read_segmenter(path).classes))
    assert counts == [3, 32]


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        ({"size": None}, "net.json: expected size, scaling, layout, dtype, classes, output, found no size"),
        ({"sizes": 3}, "net.json: expected size, scaling, layout, dtype, classes, output, tensor, licence, found 'sizes'"),
        ({"size": [4, 6.0]}, 'net.json: size: expected [height, width] in pixels, or "any", found [4, 6.0]'),
        ({"size": [0, 6]}, "net.json: size: expected [height"),
        ({"size": "all"}, "net.json: size: expected [height"),
        ({"layout": "CHW"}, "net.json: layout: expected NCHW, NHWC, found 'CHW'"),
        ({"layout": ["NCHW"]}, "net.json: layout: expected NCHW, NHWC"),
        ({"dtype": "double"}, "net.json: dtype: expected float32, float16, uint8, int8, found 'double'"),
        ({"output": "labels"}, "net.json: output: expected logits, probabilities, class numbers, found 'labels'"),
        ({"classes": ["wall", 3]}, "net.json: classes: expected a list of names"),
        ({"classes": ["wall", " "]}, "net.json: classes: expected a list of names"),
        ({"classes": ["wall", "wall"]}, "net.json: classes: expected 1 to 255 different names"),
        ({"classes": []}, "net.json: classes: expected 1 to 255 different names"),
        ({"scaling": {"mean": 0.5}}, "net.json: scaling: expected an object with mean and std, or with offset and scale"),
        ({"scaling": {"mean": 0.5, "std": 0}}, "net.json: scaling.std: expected positive numbers, found 0"),
        ({"scaling": {"mean": [1, 2], "std": 1}}, "net.json: scaling.mean: expected a number, or three, found [1, 2]"),
        ({"scaling": {"mean": True, "std": 1}}, "net.json: scaling.mean: expected a number, or three, found True"),
        ({"licence": ""}, "net.json: licence: expected text, found ''"),
        ({"tensor": 4}, "net.json: tensor: expected text, found 4"),
        ({"layout": "NHWC"}, "net.json: layout: expected an input of net.onnx: [1, 3, 4, 6], found [1, 4, 6, 3]"),
        ({"size": [6, 4]}, "net.json: size: expected an input of net.onnx: [1, 3, 4, 6], found [1, 3, 6, 4]"),
        ({"tensor": "numbers"}, 'net.onnx: expected the "tensor" of its JSON, numbers, among its outputs, found logits'),
    ],
)  # fmt: skip
def test_a_wrong_description_is_refused_with_its_key(tmp_path, changed, expected):
    path = described(onnx(tmp_path), **changed)
    with pytest.raises(InputError) as caught:
        open_exported(path)
    assert str(caught.value).startswith(f"{tmp_path}/{expected}")


def test_another_number_type_than_the_file_has_is_refused(tmp_path):
    path = described(onnx(tmp_path), dtype="uint8")
    with pytest.raises(InputError, match=r"net\.json: dtype: expected float32, as in net\.onnx, found uint8"):
        open_exported(path)


@pytest.mark.parametrize(
    ("output", "kind", "changed", "expected"),
    [
        ("logits", "float32", {"classes": NAMES[:3]}, "found shape (1, 4, 4, 6) instead of one image with 3 classes along axis 1 (NCHW)"),
        ("numbers", "int64", {"classes": NAMES[:1], "output": "class numbers"}, "found class number 3, outside 0 to 0"),
        ("logits", "float32", {"output": "class numbers"}, "found float32 of shape (1, 4, 4, 6) instead of whole numbers [height width]"),
        ("logits", "float32", {"output": "probabilities"}, "found negative numbers"),
        ("numbers", "int64", {}, "instead of one image with 4 classes"),
    ],
)  # fmt: skip
def test_an_answer_that_is_not_as_described_is_refused(tmp_path, output, kind, changed, expected):
    segmenter = open_exported(described(onnx(tmp_path, output=output, kind=kind), **changed))
    with pytest.raises(InputError, match=r"net\.onnx: expected .* that fit net\.json, found") as caught:
        segmenter(photo())
    assert expected in str(caught.value)


def test_logits_that_are_not_finite_are_refused(tmp_path):
    path = described(tmp_path / "net.onnx")
    onnx_writer.write_pixelwise(
        path, WEIGHT * 3e38, BIAS, shape=(1, 3, *SIZE), outputs={"logits": "float32"}, dtype="float32"
    )
    with pytest.raises(InputError, match="found NaN or infinity"):
        open_exported(path)(np.full((*SIZE, 3), 255, np.uint8))


def test_missing_and_damaged_files_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"net\.onnx: expected an exported network, found nothing"):
        open_network(described(tmp_path / "net.onnx"))
    path = onnx(tmp_path)
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(InputError, match=r"net\.onnx: expected a network that onnxruntime can run"):
        open_network(path)
    path = litert(tmp_path)
    path.write_bytes(b"no network")
    with pytest.raises(InputError, match=r"net\.tflite: expected a network that LiteRT can run"):
        open_network(path)
    path.with_suffix(".json").unlink()
    with pytest.raises(InputError, match=r"net\.json: expected the description of an exported network"):
        open_network(path)


def test_several_outputs_need_a_name(tmp_path):
    path = described(tmp_path / "net.onnx")
    outputs = {"logits": "float32", "numbers": "int64"}
    onnx_writer.write_pixelwise(path, WEIGHT, BIAS, shape=(1, 3, *SIZE), outputs=outputs)
    with pytest.raises(InputError, match="expected one output, found logits, numbers; name one in the JSON"):
        open_network(path)
    np.testing.assert_allclose(open_network(described(path, tensor="logits"))(photo()), by_hand(photo()), atol=2e-6)


def test_an_image_that_the_network_cannot_take_is_refused(tmp_path, monkeypatch):
    segmenter = open_exported(onnx(tmp_path))
    with pytest.raises(InputError, match="expected a network that can take an image of 5x7"):
        Exported(
            segmenter.path, open_exported(onnx(tmp_path, size="any")).description, segmenter.network, segmenter.made_by
        )(photo(5, 7))


@pytest.mark.parametrize(
    ("write", "library", "extra"), [(onnx, "onnxruntime", "onnx"), (litert, "ai_edge_litert", "litert")]
)
def test_a_missing_library_is_named_with_its_extra(tmp_path, monkeypatch, write, library, extra):
    path = write(tmp_path)
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.setitem(sys.modules, f"{library}.interpreter", None)
    with pytest.raises(ImportError, match=rf"pip install -e '\.\[{extra}\]'"):
        open_network(path)


@pytest.mark.parametrize(("classes", "named"), [(NAMES, True), (NAMES[:3], False)])
def test_if_no_output_has_a_number_per_class_and_pixel_none_can_be_named(tmp_path, classes, named):
    """Outputs of four numbers per pixel, and of one, for four classes and for three."""
    path = described(tmp_path / "net.onnx", classes=classes)
    onnx_writer.write_pixelwise(
        path, WEIGHT, BIAS, shape=(1, 3, *SIZE), outputs={"logits": "float32", "numbers": "int64"}
    )
    with pytest.raises(InputError) as caught:
        open_network(path)
    advice = str(caught.value).partition("net.onnx: ")[2]
    if named:
        assert advice == 'expected one output, found logits, numbers; name one in the JSON: "tensor"'
    else:
        assert advice.startswith(
            "expected one output, found logits [1, 4, 4, 6], numbers [1, 4, 6]; none of them has a number for each of the 3 classes"
        )
