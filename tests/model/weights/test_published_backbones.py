"""Published backbones as a start."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from semgs.files.errors import InputError
from semgs.model.classes.mobilenet import MobileNetV2
from semgs.model.classes.mosaic import OWN_LAYERS, Mosaic
from semgs.model.weights.initial_weights import fill_backbone, initial_network, is_mosaic, is_published
from semgs.model.weights.load import load, shipped


def published(path: Path, **changes: torch.Tensor | None) -> dict[str, torch.Tensor]:
    """A file as published: weights in float16, biases in float32; changed tensors, None for those to leave out."""
    torch.manual_seed(7)
    tensors = {}
    for name, tensor in MobileNetV2().state_dict().items():
        tensors[name] = torch.randn(tensor.shape).to(torch.float16 if name.endswith("weight") else torch.float32)
    tensors = {name: tensor for name, tensor in (tensors | changes).items() if tensor is not None}
    save_file(tensors, path)
    return tensors


HEAD = {"top.weight": torch.ones(8, 320, 1, 1), "top.bias": torch.ones(8), "classifier.weight": torch.ones(3, 8)}


def test_the_backbone_is_taken_and_heads_are_left_out(tmp_path: Path):
    path = tmp_path / "start.safetensors"
    tensors, backbone = published(path, **HEAD), MobileNetV2()
    assert is_published(path)
    origin = fill_backbone(backbone, path)
    assert origin == "start.safetensors: 102 of 105 tensors taken for the backbone; left out: classifier, top"
    for name, tensor in backbone.state_dict().items():
        assert tensor.dtype == torch.float32
        assert torch.equal(tensor, tensors[name].float())


def test_a_file_without_a_head_is_taken_whole(tmp_path: Path):
    published(tmp_path / "start.safetensors")
    assert fill_backbone(MobileNetV2(), tmp_path / "start.safetensors") == (
        "start.safetensors: 102 of 102 tensors taken for the backbone"
    )


@pytest.mark.parametrize(
    ("name", "tensor", "told"),
    [
        ("blocks.3.expand.bias", None, r"a tensor of shape \(144,\), as in MobileNetV2 1.0, found none"),
        (
            "stem.weight",
            torch.ones(24, 3, 3, 3),
            r"shape \(32, 3, 3, 3\), as in MobileNetV2 1.0, found \(24, 3, 3, 3\)",
        ),
        ("blocks.17.expand.weight", torch.ones(1), "the 102 tensors of MobileNetV2 1.0, found one more"),
        ("stem.bias", torch.full((32,), torch.nan), "finite numbers, found one that is not"),
    ],
)
def test_a_tensor_that_does_not_fit_is_named_and_nothing_is_taken(tmp_path: Path, name, tensor, told):
    path = tmp_path / "start.safetensors"
    published(path, **{name: tensor})
    backbone = MobileNetV2()
    before = {name: one.clone() for name, one in backbone.state_dict().items()}
    with pytest.raises(InputError, match=f"start.safetensors: {name}: expected {told}"):
        fill_backbone(backbone, path)
    assert all(torch.equal(one, before[name]) for name, one in backbone.state_dict().items())


def test_a_published_file_is_known_by_its_names(tmp_path: Path):
    (tmp_path / "text.safetensors").write_text("no safetensors")
    save_file({"stem.weight": torch.ones(1)}, tmp_path / "stem.safetensors")
    assert not is_published(tmp_path / "text.safetensors")
    assert not is_published(tmp_path / "nowhere.safetensors")
    assert not is_published(tmp_path / "stem.safetensors")
    assert not is_published(str(shipped("small")))
    with pytest.raises(InputError, match=r"text.safetensors: expected a complete safetensors file"):
        fill_backbone(MobileNetV2(), tmp_path / "text.safetensors")
    for name, found in (("nowhere.safetensors", "no such file"), (".", "Is a directory")):
        with pytest.raises(InputError, match=rf"expected a complete safetensors file, found {found}$"):
            fill_backbone(MobileNetV2(), tmp_path / name)


def test_the_published_files_beside_the_project_are_such(shared: Path):
    files = sorted((shared / "pretrained").glob("*.safetensors"))
    if not files:
        pytest.skip("the published weights are not here")
    others = [path for path in files if path.name == "mosaic_ade32.safetensors"]  # named alike, with other sizes
    assert [fill_backbone(MobileNetV2(), path) for path in files if is_published(path) and path not in others] == [
        "deeplabv3_mobilenet_v2_voc_backbone.safetensors: 102 of 102 tensors taken for the backbone",
        "deeplabv3plus_mobilenet_v2_ade32.safetensors: 102 of 120 tensors taken for the backbone; left out: aspp, classes, decoder",
        "mobilenet_v2_imagenet.safetensors: 102 of 106 tensors taken for the backbone; left out: classifier, top",
    ]
    for path in others:
        with pytest.raises(InputError, match=r"expected shape \(32, 1, 3, 3\), as in MobileNetV2 1.0"):
            fill_backbone(MobileNetV2(), path)


@pytest.mark.long
def test_a_training_starts_from_a_published_file_alone_or_beside_weights(tmp_path: Path):
    path = tmp_path / "backbone.safetensors"
    tensors = published(path)
    alone = initial_network("small", str(path), seed=2)
    beside = initial_network("small", "small", seed=2, switches={"class_backbone": True}, backbone=str(path))
    for model in (alone, beside):
        assert all(
            torch.equal(model.semantic.refinement.backbone.state_dict()[name], one.float())
            for name, one in tensors.items()
        )
        assert model.origin.endswith("102 of 102 tensors taken for the backbone")
    shipped = load("small").state_dict()
    lent = beside.parts()["depth"] | beside.parts()["colour"]
    assert all(torch.equal(beside.state_dict()[name], shipped[name]) for name in lent)
    with pytest.raises(InputError, match="expected a network with a MobileNetV2 class backbone, found one without"):
        initial_network("small_plain", "random", backbone=str(path))


def test_mosaic_is_filled_from_its_own_file_but_for_the_layers_of_our_classes(tmp_path: Path):
    path = tmp_path / "mosaic.safetensors"
    torch.manual_seed(7)
    theirs = {name: one for name, one in Mosaic(3).state_dict().items() if not name.startswith(OWN_LAYERS)}
    tensors = {name: torch.randn(one.shape).half() for name, one in theirs.items()}
    save_file(tensors, path)
    assert is_published(path)
    assert is_mosaic(path)
    model = initial_network("small_plain", "random", seed=2, switches={"class_mosaic": True}, backbone=str(path))
    own = model.semantic.mosaic.state_dict()
    assert model.origin.endswith(f"mosaic.safetensors: {len(tensors)} tensors taken for MOSAIC")
    assert all(torch.equal(own[name], one.float()) for name, one in tensors.items())
    assert not any(one.any() for name, one in own.items() if name not in tensors and name != "mixture.known")
    with pytest.raises(InputError, match="expected a network with MOSAIC, found one without"):
        initial_network("small_plain", "random", backbone=str(path))
    save_file({**tensors, "more.weight": torch.ones(1)}, path)
    with pytest.raises(InputError, match="tensors of MOSAIC, found one more"):
        initial_network("small_plain", str(path))


def test_a_mobilenet_is_not_mosaic(tmp_path: Path):
    published(tmp_path / "start.safetensors", **HEAD)
    assert not is_mosaic(tmp_path / "start.safetensors")
    assert not is_mosaic(tmp_path / "nowhere.safetensors")
