"""The world is pinned: the same rooms, things and cameras on every machine that runs these tests, nearly the same labels.

Pictures are not pinned: the last bits of what NumPy, libm, BLAS and embree reckon differ between CPUs. Digests are taken of numbers
rounded so far that those bits are gone: plans to nine decimals (nanometres), cameras as `transforms.json` has them. Labels may
differ where an edge passes within rounding of a pixel's centre: at one pixel of ten thousand.

Whoever changes the world on purpose writes the new digests and labels here, and says so in CHANGELOG.md.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs.files.images.pictures import read_uint8
from semgs_rooms.plans.style import STYLES
from semgs_rooms.sets.room_scenes import DrawnScene, RoomSettings, draw_scene, write_views

SEED, SCENES, FRAMES, SIZE = 3, 3, 2, (48, 64)
DECIMALS = 9
DIGESTS = {
    "home": {"plans": "ac186e85eae7579a", "cameras": "b67a823e40461455"},
    "other": {"plans": "a3d2c121a50a3e63", "cameras": "dfb2be38b966101b"},
    "closeup": {"plans": "b4fb10a10005dece", "cameras": "74181464cb1d1313"},
}
LABELS = Path(__file__).with_name("pinned_labels.png")
"""A row of frames for each scene, style after style."""


@pytest.fixture(scope="module")
def walks() -> dict[str, list[DrawnScene]]:
    return {
        style: [draw_scene(RoomSettings(SEED, SIZE, FRAMES, style), index) for index in range(SCENES)]
        for style in STYLES
    }


def rounded(value: Any) -> Any:
    """Dataclasses, arrays and numbers as JSON holds them."""
    if is_dataclass(value):
        return {field.name: rounded(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [rounded(each) for each in value]
    return round(value, DECIMALS) + 0.0 if isinstance(value, float) else value  # + 0.0: of -0.0 too


def digest(texts: list[str]) -> str:
    return hashlib.sha256("".join(texts).encode()).hexdigest()[:16]


@pytest.mark.parametrize("style", STYLES)
def test_rooms_and_all_that_is_in_them_are_those_of_every_other_machine(walks, style):
    plans = [rounded(walk.plan) for walk in walks[style]]
    for plan in plans:
        del plan["instances"]  # which parts are one thing, of a world that was there before
    assert digest([json.dumps(plan) for plan in plans]) == DIGESTS[style]["plans"]


@pytest.mark.parametrize("style", STYLES)
def test_cameras_are_written_as_on_every_other_machine(walks, style, tmp_path):
    texts = []
    for number, walk in enumerate(walks[style]):
        folder = tmp_path / str(number)
        folder.mkdir()
        write_views(folder, walk.views)
        texts.append((folder / "transforms.json").read_text())
    assert digest(texts) == DIGESTS[style]["cameras"]


def test_labels_are_those_of_other_machines_at_9999_of_10000_pixels(walks):
    labels = np.concatenate(
        [np.concatenate(list(walk.views.labels.numpy()), axis=1) for style in STYLES for walk in walks[style]]
    )
    pinned = read_uint8(LABELS)
    assert labels.shape == pinned.shape
    assert (labels == pinned).mean() >= 0.9999
