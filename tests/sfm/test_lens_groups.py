"""Photos of one size and several lenses: each group gets its focal length, and the note says so."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pycolmap_photos import FOCAL, poses_of, take

from semgs.data.cameras.lens import Lens
from semgs.sfm.lens_groups import describe_groups, group_by_focal, may_be_several
from semgs.sfm.photos import UprightPhoto
from semgs.sfm.scene_folder import PhotoDetails, write_photo_scene
from semgs.sfm.solving import PosedPhoto, Solution, focal_limits

SIZE = (240, 320)


@dataclass
class Model:
    """A model in which each photo has a camera of its own."""

    focal: dict[str, float]
    images: dict[int, SimpleNamespace] = field(init=False)
    cameras: dict[int, SimpleNamespace] = field(init=False)

    def __post_init__(self) -> None:
        self.images = {n: SimpleNamespace(name=name, camera_id=n, has_pose=True) for n, name in enumerate(self.focal)}
        self.cameras = {n: SimpleNamespace(params=[value, 160.0, 120.0]) for n, value in enumerate(self.focal.values())}


def photos(names: str, size: tuple[int, int] = SIZE, focal: float | None = None) -> list[UprightPhoto]:
    return [UprightPhoto(name, size, focal) for name in names]


def test_photos_are_grouped_where_focal_lengths_jump_by_more_than_20_percent():
    """250, 255 and 300 px are one lens, as 300 / 255 = 1.18; 365 / 300 = 1.22 is another, and 134 too."""
    model = Model({"a": 300.0, "b": 134.0, "c": 250.0, "d": 365.0, "e": 255.0})
    groups = group_by_focal(model, photos("abcdef"))
    assert groups["a"] == groups["c"] == groups["e"]
    assert len({groups["a"], groups["b"], groups["d"]}) == 3
    assert groups["f"] == groups["a"]  # not in the model: as most are


def test_sizes_and_focal_lengths_of_exif_are_groups_of_their_own():
    model = Model({"a": 250.0, "b": 251.0, "c": 252.0, "d": 253.0})
    listed = [*photos("a"), *photos("b", (320, 240)), *photos("c", SIZE, 250.0), *photos("d", SIZE, 250.0)]
    groups = group_by_focal(model, listed)
    assert groups["c"] == groups["d"]
    assert len(set(groups.values())) == 3


def test_the_note_names_the_photos_of_the_smaller_groups():
    def posed(name: str, focal: float) -> PosedPhoto:
        return PosedPhoto(name, Lens(SIZE, (focal, focal), (160.0, 120.0)), np.eye(4))

    some = [posed("a", 134.2), posed("b", 256.1), posed("c", 256.1)]
    said = describe_groups(some, {"a": (0,), "b": (1,), "c": (1,)})
    assert said.endswith("each group of photos has its own: 134 px for a, 256 px for the other 2.")


def test_four_photos_without_a_known_focal_length_may_have_several_and_a_clip_has_one():
    assert may_be_several(photos("abcd"), ordered=False)
    assert not may_be_several(photos("abcd"), ordered=True)
    assert not may_be_several([*photos("abc"), *photos("d", SIZE, 250.0)], ordered=False)


@pytest.mark.parametrize(
    ("focal", "limits"),
    [
        (None, (0.3, 3.0)),
        (256.0, (0.3, 3.0)),
        (80.0, (0.25 / 1.4, 3.0)),  # 0.25 of the longer side
        (1110.0, (0.3, 1110 / 320 * 1.4)),  # 120 mm: 3.47 of it
    ],
)
def test_focal_lengths_near_a_known_one_are_plausible_however_wide_the_lens(focal, limits):
    assert focal_limits(UprightPhoto("a", SIZE, focal)) == pytest.approx(limits)


def offsets(found: Solution, true: np.ndarray) -> np.ndarray:
    """How far cameras are off after alignment, over their mean distance from the middle."""
    ours = np.array([photo.world_from_camera[:3, 3] for photo in found.photos])
    a, b = ours - ours.mean(0), true[:, :3, 3] - true[:, :3, 3].mean(0)
    u, s, v = np.linalg.svd(a.T @ b)
    signs = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    scale = (s * np.diag(signs)).sum() / (a**2).sum()
    return np.linalg.norm(scale * a @ u @ signs @ v - b, axis=1) / np.linalg.norm(b, axis=1).mean()


@pytest.mark.long
@pytest.mark.parametrize(("others", "factor"), [((4,), 0.6), ((2, 5), 1.7), ((), 1.0)])
def test_photos_of_another_lens_get_its_focal_length(tmp_path: Path, others: tuple[int, ...], factor: float):
    taken = take(tmp_path / "photos", poses_of(8), focal=lambda index: FOCAL * (factor if index in others else 1.0))
    (tmp_path / "scene").mkdir()
    found = write_photo_scene(taken.folder, tmp_path / "scene", PhotoDetails(), lambda line: None)
    assert len(found.photos) == 8
    assert offsets(found, taken.world_from_camera).max() < 0.05
    for index, photo in enumerate(found.photos):
        assert photo.lens.focal[0] == pytest.approx(FOCAL * (factor if index in others else 1.0), rel=0.05)
    assert ("2 focal lengths" in found.notes[-1]) == bool(others)
