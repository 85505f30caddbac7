import ast
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
import torch
from golden import golden_tensor
from networks import preset
from safetensors.torch import save_file

from semgs import load
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.geometry.cameras import Cameras
from semgs.geometry.harmonics import basis
from semgs.geometry.rotations import covariance
from semgs.model.weights.load import our_name, renamed
from semgs.model.weights.weights_file import fill

AGREEMENT = 1e-4


@pytest.fixture(scope="module")
def state(shared) -> dict[str, torch.Tensor]:
    """MVSplat's 471 tensors by its own names, drawn by the golden rule."""
    lines = (shared / "reference" / "mvsplat_state_dict.txt").read_text().splitlines()
    shapes = dict(line.split(None, 1) for line in lines if line and not line.startswith("#"))
    return {f"encoder.{key}": golden_tensor(key, ast.literal_eval(shape)) for key, shape in shapes.items()}


@pytest.fixture(scope="module")
def checkpoint(state, tmp_path_factory):
    path = tmp_path_factory.mktemp("mvsplat") / "re10k.ckpt"
    torch.save({"state_dict": state, "epoch": 3}, path)
    return path


@pytest.fixture(scope="module")
def fixture(shared):
    return np.load(shared / "golden" / "mvsplat_2x64x96.npz")


@pytest.fixture(scope="module")
def activations(checkpoint, fixture):
    model = load("mvsplat", weights=checkpoint).eval()
    height, width = fixture["image"].shape[-2:]
    k = torch.from_numpy(fixture["intrinsics_normalised"]).double() * torch.tensor([width, height, 1.0])[:, None]
    cameras = Cameras(fixture["camera_to_world"], k, (height, width))
    views = Views(
        torch.from_numpy(fixture["image"]),
        cameras,
        torch.tensor([[[float(fixture["near"]), float(fixture["far"])]] * 2]),
    )
    kept: dict[str, torch.Tensor] = {}

    def keep(**names: object):
        def hook(_module, inputs, output) -> None:
            for name, pick in names.items():
                kept[name] = pick(inputs, output)

        return hook

    model.cnn.register_forward_hook(keep(cnn=lambda i, o: o))
    model.colour.transformer.swin.register_forward_hook(keep(transformer=lambda i, o: o.transpose(0, 1)))
    model.colour.depth.regressor.register_forward_hook(keep(cost_volume=lambda i, o: i[0], depth_logits=lambda i, o: o))
    model.colour.heads.refinement.register_forward_hook(keep(refine_unet=lambda i, o: o[0]))
    with torch.inference_mode():
        encoding = model(views)
    gaussians = encoding.gaussians
    kept |= {
        "depth": encoding.depths,
        "opacity": gaussians.opacities,
        "means": gaussians.means,
        "covariances": covariance(gaussians.colour.quaternions, gaussians.colour.scales),
    }
    assert gaussians.semantic is None
    return kept, gaussians


@pytest.mark.parametrize(
    "name",
    ["cnn", "transformer", "cost_volume", "depth_logits", "refine_unet", "depth", "opacity", "means", "covariances"],
)
def test_every_array_of_the_authors_code_is_reproduced(activations, fixture, name):
    expected = torch.from_numpy(fixture[name])
    found = activations[0][name].reshape(expected.shape)
    assert (found - expected).norm() / expected.norm() < AGREEMENT


def test_colours_are_the_authors_from_every_direction(activations, fixture):
    directions = torch.nn.functional.normalize(torch.randn(50, 3, dtype=torch.float64), dim=-1)
    theirs = torch.from_numpy(fixture["harmonics"][0]).double()  # gaussian, colour, k in the renderer's basis
    expected = torch.einsum("dk,gck->dgc", basis(directions.roll(1, dims=-1), 3), theirs)
    found = torch.einsum("dk,gkc->dgc", basis(directions, 3), activations[1].colour.features[0].double())
    assert (found - expected).norm() / expected.norm() < AGREEMENT


def test_all_471_names_and_shapes_are_ours_too_and_base_s(state):
    assert len(state) == 471
    shapes = {our_name(name): tensor.shape for name, tensor in state.items()}
    assert shapes == {name: tensor.shape for name, tensor in preset("mvsplat").state_dict().items()}
    base = {name: tensor.shape for name, tensor in preset("base").state_dict().items()}
    assert {name: shape for name, shape in base.items() if not name.startswith("semantic.")} == shapes


def test_safetensors_of_the_same_names_load_alike(state, checkpoint, tmp_path):
    save_file(state, tmp_path / "re10k.safetensors")
    a = load("mvsplat", weights=tmp_path / "re10k.safetensors").state_dict()
    b = load("mvsplat", weights=checkpoint).state_dict()
    assert all(torch.equal(a[name], b[name]) for name in b)


def test_base_takes_all_tensors_and_draws_its_semantic_branch(state, checkpoint):
    base = load("base", weights=checkpoint, seed=3)
    fresh = load("base", weights="random", seed=3)
    assert "all 471 tensors of MVSplat taken" in base.origin
    own = base.state_dict()
    assert all(torch.equal(own[our_name(name)], tensor) for name, tensor in state.items())
    semantic = [name for name in own if name.startswith("semantic.")]
    assert semantic
    assert all(torch.equal(own[name], fresh.state_dict()[name]) for name in semantic)


def test_heads_of_the_papers_text_are_drawn_and_all_else_is_mvsplats(state, checkpoint):
    network, plain = load("base_text", weights=checkpoint), load("base_text", weights="random")
    theirs = {our_name(name): tensor for name, tensor in state.items()}
    own = network.state_dict()
    taken = {name for name in own if name in theirs and not name.startswith("colour.heads.")}
    heads = {name for name in own if name.startswith("colour.heads.")}
    assert f"{len(taken)} tensors of MVSplat taken" in network.origin
    assert f"and {len(heads)} tensors of the colour heads drawn at random with seed 0" in network.origin
    assert {name.split(".")[0] for name in set(own) - taken - heads} == {"semantic"}
    assert all(torch.equal(own[name], theirs[name]) for name in taken)
    assert all(torch.equal(own[name], plain.state_dict()[name]) for name in heads)


def test_every_one_of_the_471_is_missed_by_its_name_and_measured(state, monkeypatch):
    """On a network whose tensors take no memory: what is missing or of another shape is told before any is looked at."""
    with torch.device("meta"):
        model = preset("mvsplat")
    wanted = model.state_dict()
    monkeypatch.setattr(model, "state_dict", lambda: wanted)
    tensors = renamed(state, Path("re10k.ckpt"))
    for name, tensor in tensors.items():
        rest = {key: value for key, value in tensors.items() if key != name}
        with pytest.raises(InputError, match=f"{re.escape(name)}: expected a tensor of shape"):
            fill(model, rest, Path("re10k.ckpt"), model.name)
        with pytest.raises(InputError, match=f"{re.escape(name)}: expected shape"):
            fill(model, rest | {name: tensor[None]}, Path("re10k.ckpt"), model.name)
    with pytest.raises(InputError, match=r"cnn\.surplus"):
        fill(model, tensors | {"cnn.surplus": torch.zeros(2)}, Path("re10k.ckpt"), model.name)


@pytest.mark.parametrize("network", ["mvsplat", "base"])
@pytest.mark.parametrize("fault", ["missing", "extra", "shape"])
def test_a_tensor_that_does_not_fit_is_named(state, tmp_path, fault, network):
    broken = dict(state)
    name = "encoder.depth_predictor.proj_feature.bias"
    if fault == "missing":
        del broken[name]
    elif fault == "extra":
        broken[name := "encoder.backbone.surplus"] = torch.zeros(2)
    else:
        broken[name] = torch.zeros(31)
    torch.save({"state_dict": broken}, tmp_path / "broken.ckpt")
    with pytest.raises(InputError, match=(our_name(name) or name).replace(".", r"\.")):
        load(network, weights=tmp_path / "broken.ckpt")


class Surprise:
    """An object that a pickle would build, by writing a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple:
        return Path.touch, (self.path,)


@pytest.mark.parametrize("form", ["checkpoint", "old checkpoint", "bare pickle"])
def test_what_needs_unpickling_is_refused_and_nothing_of_it_runs(state, tmp_path, form):
    path, sprung = tmp_path / "pickle.ckpt", tmp_path / "sprung"
    content = {"state_dict": state, "surprise": Surprise(sprung)}
    if form == "bare pickle":
        path.write_bytes(pickle.dumps({"surprise": Surprise(sprung)}))
    else:
        torch.save(content, path, _use_new_zipfile_serialization=form == "checkpoint")
    for network in ("mvsplat", "base"):
        with pytest.raises(InputError, match="weights_only" if form == "checkpoint" else "safetensors"):
            load(network, weights=path)
    assert not sprung.exists()


@pytest.mark.filterwarnings("ignore:.torch.jit:DeprecationWarning")
def test_an_archive_of_torchscript_is_refused_without_the_advice_to_run_it(tmp_path):
    torch.jit.save(torch.jit.script(torch.nn.Identity()), tmp_path / "scripted.ckpt")
    with pytest.raises(InputError, match=r"scripted\.ckpt: expected .*, found a TorchScript archive$"):
        load("mvsplat", weights=tmp_path / "scripted.ckpt")


@pytest.mark.parametrize("content", [{"epoch": 3}, {"state_dict": {"encoder.backbone": 1}}, [1, 2]])
def test_a_checkpoint_without_tensors_is_refused(content, tmp_path):
    torch.save(content, tmp_path / "empty.ckpt")
    with pytest.raises(InputError, match="state_dict: expected a dictionary of tensors"):
        load("mvsplat", weights=tmp_path / "empty.ckpt")


def test_small_takes_no_weights_of_mvsplat(checkpoint):
    with pytest.raises(InputError, match='weights of "small", written by semgs'):
        load("small", weights=checkpoint)


class Schedule:
    """Stands for what Lightning keeps of a scheduler."""


def test_a_lightning_checkpoint_with_objects_names_the_way_out(state, tmp_path):
    """As Lightning writes them: epoch, loops, callbacks and schedulers beside the tensors; plain containers are no hindrance."""
    plain = {
        "epoch": 3,
        "global_step": 300_000,
        "callbacks": {"ModelCheckpoint{}": {"best_model_score": torch.tensor(1.0)}},
    }
    torch.save({"state_dict": state, "lr_schedulers": [{"last_epoch": 3}], **plain}, tmp_path / "plain.ckpt")
    assert "471 tensors of MVSplat taken" in load("mvsplat", weights=tmp_path / "plain.ckpt").origin
    torch.save({"state_dict": state, "lr_schedulers": [Schedule()], **plain}, tmp_path / "objects.ckpt")
    with pytest.raises(
        InputError, match=r"found an object, test_mvsplat\.Schedule; if you trust it, extract its tensors once"
    ) as told:
        load("mvsplat", weights=tmp_path / "objects.ckpt")
    assert "weights_only=False" not in str(told.value)
    assert len(str(told.value).splitlines()) == 1
