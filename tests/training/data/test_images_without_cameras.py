"""Training on labelled images without cameras."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from image_sets import random_numbers, write_image_set
from scenes_on_disk import write_labelled
from training_data import run_data, run_portions, run_validation

from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png
from semgs.training.data.data_settings import Augmentation
from semgs.training.training_settings import TrainingSettings

SETTINGS = TrainingSettings(
    model="small_plain", steps=6, batch=4, size=(16, 24), supervision="pictures", seed=3,
    validation_scenes=0, augmentation=Augmentation(crop=0.5, flip=True, roll=10.0),
)  # fmt: skip


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """Three images of different sizes."""
    sizes = ((32, 48), (48, 32), (40, 40))
    return write_image_set(tmp_path / "photos", {f"{k}": random_numbers(k, size) for k, size in enumerate(sizes)})


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    for number in range(3):
        write_labelled(tmp_path / f"rooms/scene{number}", number, frames=4)
    return tmp_path / "rooms"


def batches(settings: TrainingSettings, run: Path) -> list:
    run.mkdir()
    portions = list(run_portions(settings, run))
    assert [portion.failure for portion in portions] == [None] * len(portions)
    return [batch for portion in portions for batch in portion.pieces]


def different(images: torch.Tensor) -> bytes:
    return images.numpy().tobytes()


def test_images_mix_with_scenes_by_their_weights(photos: Path, scenes: Path, tmp_path: Path):
    settings = replace(SETTINGS, data=(f"{scenes}=1", f"{photos}=3"))
    found = batches(settings, tmp_path / "run")
    assert all(batch.context.images.shape == (4, 1, 3, 16, 24) for batch in found)
    assert [sum(name == "photos" for name in batch.scenes) for batch in found] == pytest.approx([3] * 6, abs=1)
    assert Counter(name == "photos" for batch in found for name in batch.scenes)[True] == pytest.approx(18, abs=1)


def test_every_image_comes_before_one_comes_again(photos: Path, tmp_path: Path):
    settings = replace(SETTINGS, data=(str(photos),), batch=3, steps=4, augmentation=Augmentation())
    for batch in batches(settings, tmp_path / "run"):
        assert len({different(batch.context.images[k]) for k in range(3)}) == 3


def test_classes_are_counted_in_every_image(tmp_path: Path):
    numbers = {f"{k:02d}": np.full((16, 24), k == 8, np.uint8) for k in range(10)}
    photos = write_image_set(tmp_path / "photos", numbers)
    (tmp_path / "run").mkdir()
    settings = replace(SETTINGS, data=(str(photos),), class_weights="inverse_root_frequency")
    weights = run_data(settings, tmp_path / "run").class_weights
    # Walls are nine tenths of all pixels and floor one: factors in the ratio of 1 to 3, with a mean of 1 over pixels.
    assert weights is not None
    assert weights[1] / weights[0] == pytest.approx(3, rel=1e-3)
    assert 0.9 * weights[0] + 0.1 * weights[1] == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize(
    "others",
    [
        {"supervision": "rendered", "contexts": (2, 2), "targets": 1},
        {"supervision": "labels", "contexts": (2, 2), "targets": 1},
        {"supervision": "depth", "contexts": (2, 2), "targets": 1},
    ],
)
def test_any_other_supervision_refuses_them_by_name(photos: Path, scenes: Path, tmp_path: Path, others: dict):
    settings = replace(SETTINGS, augmentation=Augmentation(), **others)
    told = f"images with cameras, for --supervision {others['supervision']}, found labelled images.*give --supervision pictures"
    with pytest.raises(InputError, match=told):
        run_data(replace(settings, data=(str(photos),)), tmp_path)
    with pytest.raises(InputError, match=told):
        run_data(replace(settings, data=(str(scenes),), validation=str(photos), validation_scenes=1), tmp_path)


def test_validation_shows_each_image_once(photos: Path, tmp_path: Path):
    settings = replace(SETTINGS, data=("rooms",), validation=str(photos), validation_scenes=3)
    found = run_validation(settings, tmp_path)
    assert len({different(batch.context.images) for batch in found}) == 3


@pytest.mark.parametrize("class_weights", [None, "inverse_root_frequency"])
def test_labels_as_colours_are_refused_by_what_they_are(tmp_path: Path, class_weights: str | None):
    """Not as labels that are missing. One image whose labels can be read is enough to begin, as training counts the others."""
    photos = write_image_set(tmp_path / "photos", {name: np.zeros((16, 24), np.uint8) for name in "ab"})
    for name in "ab":
        write_png(photos / f"labels/{name}.png", np.full((16, 24, 3), (0, 128, 64), np.uint8))
    settings = replace(SETTINGS, data=(str(photos),), class_weights=class_weights)
    told = r"a\.png: expected a PNG of one channel, found a PNG of mode RGB; convert its colours to class numbers$"
    with pytest.raises(InputError, match=told):
        run_data(settings, tmp_path)
    write_png(photos / "labels/b.png", np.zeros((16, 24), np.uint8))
    assert run_data(settings, tmp_path).scenes == 1
