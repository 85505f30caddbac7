"""Where a training starts, and what it keeps of weights."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from posed import posed_views

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.geometry.plane_sweep import expected_depth
from semgs.model.layers.network_input import widen
from semgs.model.settings import TwoBlocks
from semgs.model.switches import switched
from semgs.model.weights.initial_weights import initial_network
from semgs.model.weights.load import load, shipped
from semgs.model.weights.weights_file import save

FIVE = ClassTable("five", ("wall", "floor", "seat", "bed", "lamp"), tuple((k, k, k) for k in range(5)), tuple(range(5)))


def test_other_classes_keep_all_but_the_layers_that_predict_them():
    model = initial_network("small", "small", seed=3, classes=FIVE, own_classes=True)
    there, here = load("small").state_dict(), model.state_dict()
    assert model.classes == FIVE
    other = [name for name in here if here[name].shape != there[name].shape or not torch.equal(here[name], there[name])]
    assert set(other) == model.parts()["classes"]
    assert len(other) == 4 + 6  # of the head, the backbone's classifier and MOSAIC
    for name in other:
        kept = 7 if name.startswith("semantic.head.") else 0
        assert len(here[name]) == kept + 5
        assert torch.equal(here[name][:kept], there[name][:kept]), (
            "sizes and axes of the Gaussians are those of the weights"
        )
    assert f"{len(here) - 10} of {len(here)} tensors kept" in model.origin
    assert f"drawn anew for the 5 classes of five with seed 3: {', '.join(other)}" in model.origin
    again = initial_network("small", "small", seed=3, classes=FIVE, own_classes=True).state_dict()
    assert all(torch.equal(here[name], again[name]) for name in here)


def test_the_same_classes_keep_everything():
    model = initial_network("small", str(shipped("small")), classes=SCANNET20, own_classes=True)
    there = load("small").state_dict()
    assert all(torch.equal(value, there[name]) for name, value in model.state_dict().items())
    assert model.origin == f"small.safetensors: all {len(there)} tensors kept"


def test_another_table_is_refused_unless_it_is_asked_for():
    with pytest.raises(InputError, match=r"class table five \(5 classes\), found scannet20 \(20 classes\)"):
        initial_network("small", "small", classes=FIVE)


@pytest.mark.parametrize(
    ("init", "told"),
    [("nowhere.safetensors", "a weights file"), ("base", "the name of included weights")],
)
def test_weights_that_are_not_there_are_refused(init: str, told: str):
    with pytest.raises(InputError, match=told):
        initial_network("base", init)


@pytest.mark.long
def test_weights_lend_a_network_with_another_semantic_branch_all_else(tmp_path: Path):
    save(tmp_path / "small.safetensors", initial_network("small_plain", "random"), {})
    given = load("small_plain", tmp_path / "small.safetensors")
    model = initial_network(
        "small_plain", str(tmp_path / "small.safetensors"), seed=3, switches={"class_backbone": True, "windows": 2}
    )
    there, here = given.state_dict(), model.state_dict()
    assert model.settings == switched(given.settings, {"class_backbone": True})
    kept = {name for name in here if not name.startswith("semantic.")}
    assert kept == {name for name in there if not name.startswith("semantic.")}
    assert all(torch.equal(here[name], there[name]) for name in kept)
    assert f"small.safetensors: {len(kept)} of {len(here)} tensors kept" in model.origin
    assert "the semantic branch drawn anew with seed 3" in model.origin


def test_the_semantic_branch_is_drawn_anew_where_that_is_asked_for():
    model = initial_network("small", "small", seed=3, fresh_semantics=True)
    there = load("small").state_dict()
    drawn = {name for name, tensor in model.state_dict().items() if not torch.equal(tensor, there[name])}
    assert drawn
    assert all(name.startswith("semantic.") for name in drawn)


def test_a_branch_that_is_drawn_anew_may_have_other_switches_than_that_of_the_weights(tmp_path: Path):
    save(tmp_path / "w.safetensors", initial_network("small_plain", "random"), {})
    switches = {"shared_layers": False, "windows_semantic": 1, "camera_aware_semantic": False}
    model = initial_network("small_plain", str(tmp_path / "w.safetensors"), switches=switches, fresh_semantics=True)
    assert model.settings == switched(load("small_plain", tmp_path / "w.safetensors").settings, switches)
    assert model.semantic.cnn is not None
    there = load("small_plain", tmp_path / "w.safetensors").state_dict()
    assert all(
        torch.equal(tensor, there[name])
        for name, tensor in model.state_dict().items()
        if not name.startswith("semantic.")
    )
    with pytest.raises(InputError, match="shared_layers = False"):
        initial_network("small_plain", str(tmp_path / "w.safetensors"), switches=switches)
    with pytest.raises(InputError, match="windows = 1"):
        initial_network("small_plain", str(tmp_path / "w.safetensors"), switches={"windows": 1}, fresh_semantics=True)


@pytest.mark.long
def test_a_branch_that_weights_have_is_kept_where_it_is_asked_for_again(tmp_path: Path):
    model = load("small_plain", plain(tmp_path))
    for switches in ({}, {"class_backbone": True}):
        again = initial_network("small_plain", str(tmp_path / "plain.safetensors"), seed=4, switches=switches)
        assert all(torch.equal(tensor, model.state_dict()[name]) for name, tensor in again.state_dict().items())


def test_a_branch_that_weights_have_is_exchanged_where_it_is_switched_off(tmp_path: Path):
    path = plain(tmp_path)
    model = initial_network("small_plain", str(path), seed=4, switches={"class_backbone": False})
    assert isinstance(model.settings.semantic.refinement, TwoBlocks)
    kept, there = model.state_dict(), load("small_plain", path).state_dict()
    assert all(torch.equal(kept[name], there[name]) for name in there if name.startswith(("cnn.", "colour.")))


def plain(folder: Path) -> Path:
    """Weights of a network with a class backbone and nothing added to depth."""
    save(folder / "plain.safetensors", initial_network("small_plain", "random", switches={"class_backbone": True}), {})
    return folder / "plain.safetensors"


def test_weights_lend_a_network_with_more_layers_in_depth_all_that_they_have(tmp_path: Path):
    more = {"cost_filter": 4, "depth_cue": True}
    path = plain(tmp_path)
    model = initial_network("small_plain", str(path), seed=3, switches=more)
    there, here = load("small_plain", path).state_dict(), model.state_dict()
    assert all(torch.equal(here[name], tensor) for name, tensor in there.items())
    # Five 3D convolutions; two cues of a norm and two convolutions; weight and bias each.
    assert len(here) - len(there) == 2 * (5 + 2 * 3)
    assert (
        f"plain.safetensors: {len(there)} of {len(here)} tensors kept; the layers added to depth drawn" in model.origin
    )
    views = posed_views(2, (32, 48))
    with torch.inference_mode():
        torch.testing.assert_close(model.eval().sweep(views).depths, load("small_plain", path).sweep(views).depths)
    save(tmp_path / "more.safetensors", model, {})
    there = load("small_plain", tmp_path / "more.safetensors").state_dict()
    for switches in ({}, more):
        again = initial_network(
            "small_plain", str(tmp_path / "more.safetensors"), seed=4, switches=switches
        ).state_dict()
        assert all(torch.equal(tensor, again[name]) for name, tensor in there.items())
    with pytest.raises(InputError, match="cost_filter = 8, found 4"):
        initial_network("small_plain", str(tmp_path / "more.safetensors"), switches={"cost_filter": 8})


def test_convex_upsampling_is_added_to_weights_without_it_and_then_stays(tmp_path: Path):
    path, convex = plain(tmp_path), {"depth_upsampling": "convex"}
    model = initial_network("small_plain", str(path), seed=3, switches=convex).eval()
    there, here = load("small_plain", path), model.state_dict()
    assert all(torch.equal(here[name], tensor) for name, tensor in there.state_dict().items())
    assert len(here) - len(there.state_dict()) == 8
    views = posed_views(2, (32, 48))
    with torch.inference_mode():
        before, after = there.sweep(views), model.sweep(views)
    assert torch.equal(before.depths, after.depths)
    texels = 1 / expected_depth(before.probabilities, before.candidates)
    bilinear = 1 / torch.nn.functional.interpolate(texels[:, None], scale_factor=2, mode="bilinear")[:, 0]
    torch.testing.assert_close(after.finer.mean, widen(bilinear, 2), rtol=0.1, atol=0)
    save(tmp_path / "convex.safetensors", model, {})
    for switches in ({}, convex):
        again = initial_network("small_plain", str(tmp_path / "convex.safetensors"), seed=4, switches=switches)
        assert again.settings == model.settings
        assert "all" in again.origin
    with pytest.raises(InputError, match="depth_upsampling = bilinear, found convex"):
        initial_network("small_plain", str(tmp_path / "convex.safetensors"), switches={"depth_upsampling": "bilinear"})


def test_more_layers_in_depth_and_other_classes_are_one_start(tmp_path: Path):
    path = str(plain(tmp_path))
    model = initial_network("small_plain", path, seed=3, classes=FIVE, own_classes=True, switches={"cost_filter": 4})
    assert "the layers added to depth drawn with seed 3; drawn anew for the 5 classes of five" in model.origin
    with pytest.raises(InputError, match="class table five"):
        initial_network("small_plain", path, seed=3, classes=FIVE, switches={"cost_filter": 4})


@pytest.mark.long
def test_whether_views_agree_on_classes_can_change_and_all_weights_are_kept(tmp_path: Path):
    there = load("small_plain", plain(tmp_path))
    for fuses in (True, False):
        path = str(tmp_path / "plain.safetensors")
        model = initial_network("small_plain", path, seed=3, switches={"class_fusion": fuses})
        count = len(there.state_dict())
        assert (model.fuses, model.settings.semantic.fusion) == (fuses, fuses)
        assert model.origin in (
            f"plain.safetensors: {count} of {count} tensors kept",
            f"plain.safetensors: all {count} tensors kept",
        )
        assert all(torch.equal(model.state_dict()[name], tensor) for name, tensor in there.state_dict().items())
        save(tmp_path / "plain.safetensors", model, {})


def test_a_cue_without_a_backbone_is_refused_in_one_line():
    with pytest.raises(InputError, match="depth_cue needs the class backbone"):
        initial_network("small_plain", "random", switches={"depth_cue": True})


def test_weights_of_another_network_are_refused():
    with pytest.raises(InputError, match='weights of "base", found weights of "small"'):
        initial_network("base", "small")
    with pytest.raises(InputError, match='weights of "base", found weights of "small"'):
        initial_network("base", "small", classes=FIVE, own_classes=True)


def test_switches_make_another_network_and_must_be_those_of_the_weights(tmp_path: Path):
    plain, full = (
        initial_network("small_plain", "random", seed=2),
        initial_network("small_plain", "random", seed=2, switches={"windows": 1}),
    )
    assert switched(plain.settings, {"windows": 1}) == full.settings
    assert all(torch.equal(value, full.state_dict()[name]) for name, value in plain.state_dict().items())
    save(tmp_path / "full.safetensors", full, {})
    again = initial_network("small_plain", str(tmp_path / "full.safetensors"))
    assert again.settings == full.settings
    with pytest.raises(InputError, match="weights of a network with windows = 2, found 1"):
        initial_network("small_plain", str(tmp_path / "full.safetensors"), switches={"windows": 2})


def test_mosaic_comes_beside_a_semantic_branch_that_is_kept_and_goes_again(tmp_path: Path):
    path = plain(tmp_path)
    there = load("small_plain", path).state_dict()
    more = initial_network("small_plain", str(path), seed=4, switches={"class_mosaic": True})
    here = more.state_dict()
    assert all(torch.equal(here[name], there[name]) for name in there)
    assert {name for name in here if name not in there} == {
        name for name in here if name.startswith("semantic.mosaic.")
    }
    assert more.origin == f"plain.safetensors: {len(there)} of {len(here)} tensors kept; MOSAIC drawn with seed 4"
    save(tmp_path / "more.safetensors", more, {})
    less = initial_network("small_plain", str(tmp_path / "more.safetensors"), switches={"class_mosaic": False})
    assert less.settings == load("small_plain", path).settings
    assert less.origin == f"more.safetensors: {len(there)} of {len(there)} tensors kept"
    assert all(torch.equal(less.state_dict()[name], there[name]) for name in there)
