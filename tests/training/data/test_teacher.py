"""What another network says of pictures: it follows them, is learned by a head of its own, and leaves no trace in the weights."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from posed import posed_views
from scenes_on_disk import write_labelled
from training_data import run_portions

from semgs.data.scenes import open_scene
from semgs.data.views import Batch
from semgs.files.errors import InputError
from semgs.model.weights.initial_weights import initial_network
from semgs.training.data.augmentation import Variation
from semgs.training.data.data_settings import Augmentation
from semgs.training.data.teacher import Teacher, coordinates, divergence
from semgs.training.loop import train
from semgs.training.run.checkpoints import newest_checkpoint
from semgs.training.run.execution import Execution
from semgs.training.state import averaged_weights
from semgs.training.supervision.supervision import Pictures
from semgs.training.training_settings import TrainingSettings

SETTINGS = TrainingSettings(
    model="small_plain", steps=2, batch=2, size=(32, 48), supervision="pictures", seed=3,
    validation_scenes=0,
)  # fmt: skip


def write_maps(path: Path, maps: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, maps.astype(np.float16))


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    """Two scenes of two frames; a teacher of three classes knows the first."""
    folder = tmp_path / "scans"
    for number in range(2):
        write_labelled(folder / f"scene{number}", number, frames=2)
    maps = np.random.default_rng(1).dirichlet((1, 1, 1), (2, 3, 4))
    write_maps(tmp_path / "teacher" / "scans" / "scene0.npy", maps)
    return folder


def test_what_is_said_follows_the_picture(tmp_path: Path):
    """The teacher says of each place how far right it is; so it must after the picture was turned, cut, resized and mirrored."""
    views = posed_views(1, (48, 70), seed=4)
    teacher = Teacher(tmp_path, 2)
    right = (torch.arange(70) + 0.5) / 70
    maps = torch.stack((right, 1 - right))[None, :, None, :].expand(1, 2, 48, 70)
    picture = views.changed(images=right.expand(1, 3, 48, 70).contiguous())
    mirrored = 0
    for sample in range(8):
        vary = Variation(Augmentation(crop=0.5, flip=True, roll=25.0), 3, sample)
        said = teacher.augmented_maps(maps, vary.move(coordinates(views), (40, 56)))
        assert said.shape == (1, 2, 5, 7)
        marked = torch.nn.functional.avg_pool2d(vary.move(picture, (40, 56)).images[:, :1], 8)
        assert torch.allclose(said[:, :1], marked, atol=0.01)
        mirrored += bool(marked[0, 0, 2, 0] > marked[0, 0, 2, -1])
    assert 0 < mirrored < 8


def test_without_any_variation_each_eighth_has_what_was_said_of_it(tmp_path: Path):
    views, maps = posed_views(1, (16, 24), seed=4), torch.rand(1, 5, 2, 3)
    assert torch.allclose(Teacher(tmp_path, 5).augmented_maps(maps, coordinates(views)), maps, atol=1e-6)
    assert not Teacher(tmp_path, 5).augmented_maps(None, coordinates(views)).any()


def test_the_divergence_of_an_undecided_head_is_what_the_teacher_knows():
    """A teacher that is sure is log k away from it, one that is undecided nothing; what it does not speak of counts nothing."""
    taught = torch.zeros(3, 4, 2, 3)
    taught[0, 1] = 1
    taught[1] = 0.25
    found = divergence(torch.zeros(3, 4, 4, 8), taught)  # padded by a texel at the right
    assert found.tolist() == pytest.approx([math.log(4), 0, 0], abs=1e-5)
    taught[0, :, 0] = 0  # half of it
    assert float(divergence(torch.zeros(3, 4, 4, 8), taught)[0]) == pytest.approx(math.log(4))


def test_a_teacher_in_the_home_folder(scans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert Teacher.open("~/teacher").folder == tmp_path / "teacher"


def test_maps_are_found_by_the_names_of_scene_and_source(scans: Path, tmp_path: Path):
    (tmp_path / "teacher/scans/._scene0.npy").write_bytes(b"\0\5\26\7Mac OS X")  # is ignored
    teacher = Teacher.open(tmp_path / "teacher")
    assert teacher.classes == 3
    first, second = (open_scene(scans / f"scene{number}") for number in range(2))
    assert teacher.path(second) == tmp_path / "teacher" / "scans" / "scene1.npy"
    maps = teacher.maps(first, 1)
    assert maps is not None
    assert maps.shape == (1, 3, 3, 4)
    assert teacher.maps(second, 0) is None
    write_maps(teacher.path(second), np.ones((3, 3, 4, 3)))
    with pytest.raises(InputError, match="maps of 2 frames and 3 classes, found 3 and 3"):
        teacher.maps(second, 0)


def test_a_folder_that_says_nothing_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=r"scripts/teach.py writes them"):
        Teacher.open(str(tmp_path))


def test_a_batch_has_zeros_where_the_teacher_says_nothing(scans: Path, tmp_path: Path):
    settings = replace(SETTINGS, data=(str(scans),), teacher=str(tmp_path / "teacher"))
    (tmp_path / "run").mkdir()
    for portion in run_portions(settings, tmp_path / "run"):
        (batch,) = portion.pieces
        assert batch.taught.shape == (2, 1, 3, 4, 6)
        sums = dict(zip(batch.scenes, batch.taught.sum(2).flatten(1).mean(1).tolist(), strict=True))
        assert sums["scene0"] == pytest.approx(1, abs=1e-3)
        assert sums["scene1"] == 0


def test_a_network_that_does_not_classify_by_itself_has_no_place_for_a_head():
    with pytest.raises(InputError, match="class-backbone"):
        Pictures(teacher_classes=3).head(initial_network("small_plain", "random"))


def test_a_teacher_of_the_networks_own_classes_needs_no_head_and_must_have_as_many():
    network = initial_network("small", "random")
    assert Pictures(teacher_classes=20, teacher_target="classes").head(network) is None
    with pytest.raises(InputError, match=r"20 classes.*3 classes.*--teacher-target head"):
        Pictures(teacher_classes=3, teacher_target="classes").head(network)


def test_a_network_that_learns_itself_as_a_teacher_changes_nothing_and_an_undecided_teacher_moves_every_layer():
    network = initial_network("small", "random").train()
    views = posed_views(2, (32, 48), seed=5).map(lambda maps: maps[None])
    views = views.changed(labels=torch.full((1, 2, 32, 48), 255, dtype=torch.uint8))
    learn = Pictures(teacher_classes=20, teacher_weight=3.0, teacher_target="classes")
    names = learn.learning(network)
    for name, parameter in network.named_parameters():
        parameter.requires_grad_(name in names)
    logits = network.semantic.refinement.classifier(network.class_maps(views, alone=True).evidence)
    own = torch.nn.functional.avg_pool2d(logits, 2).softmax(1).detach()[None]
    for taught, expected in ((own, 0.0), (torch.full_like(own, 1 / 20), None)):
        network.zero_grad()
        terms = learn.loss(network, Batch(views, views.select([]), ("a",), taught))
        terms["total"].backward()
        gradients = [parameter.grad.abs().max() for name, parameter in network.named_parameters() if name in names]
        if expected is not None:
            assert float(terms["total"].detach()) == pytest.approx(expected, abs=1e-5)
        else:
            assert float(terms["total"].detach()) > 0
            assert min(map(float, gradients)) > 0


@pytest.mark.long
def test_a_run_with_a_teacher_resumes_exactly_and_keeps_its_head_to_itself(scans: Path, tmp_path: Path):
    network = replace(SETTINGS.network, class_backbone=True)
    settings = replace(SETTINGS, data=(str(scans),), teacher=str(tmp_path / "teacher"), network=network, steps=3)
    train(settings, tmp_path / "whole", Execution(workers=0))
    whole = newest_checkpoint(tmp_path / "whole" / "checkpoints")
    while not train(settings, tmp_path / "cut", Execution(workers=0, minutes=1e-9)).finished:
        pass
    cut = newest_checkpoint(tmp_path / "cut" / "checkpoints")
    assert whole is not None
    assert cut is not None
    assert all(torch.equal(tensor, cut.tensors[name]) for name, tensor in whole.tensors.items())
    assert whole.tensors["head.weight"].shape == (3, 96, 1, 1)
    assert whole.tensors["head.weight"].abs().max() > 0
    assert "optimizer.head.weight/exp_avg" in whole.tensors
    assert not [name for name in averaged_weights(whole.tensors) if name.startswith("head")]
