"""Features of Gaussians: where they land, what views say together, what is kept, and what is refused."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes_on_disk import write_labelled

from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.scene.encoding import Encoding
from semgs.segmenters.features.compression import Compression
from semgs.segmenters.features.feature_files import FeatureFiles
from semgs.segmenters.features.scene_features import (
    Featuring,
    SceneFeatures,
    _spread,
    _Tally,
    load_features,
    save_features,
    unit_features,
)

NUMBERS = 6


@dataclass(frozen=True)
class Made:
    """Features from a function of (frame's name, photo's size)."""

    make: Callable[[str, tuple[int, int]], np.ndarray]
    title: str = "made up"
    read: list[str] = field(default_factory=list)

    def of(self, frame: Frame) -> np.ndarray:
        self.read.append(frame.name)
        return self.make(frame.name, frame.lens.size)


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return open_scene(write_labelled(tmp_path / "scan", 3, frames=3))


def encoding(views: Views, depths: tuple[float, ...], stride: int = 1) -> Encoding:
    """Gaussians for each pixel, or block of pixels, of views that show a depth each, which is sure."""
    height, width = views.size
    count = len(views) * -(-height // stride) * -(-width // stride)
    shape = Appearance(torch.tensor([1.0, 0, 0, 0]).expand(count, 4), torch.full((count, 3), 0.1), torch.zeros(count, 1, 3))  # fmt: skip
    gaussians = Gaussians(torch.zeros(count, 3), torch.full((count,), 0.5), shape)
    maps = torch.ones(len(views), height, width) * torch.tensor(depths)[:, None, None]
    return Encoding(gaussians, maps, maps, torch.full_like(maps, 1e-3), views.depth_range, stride=stride)


def columns(name: str, size: tuple[int, int]) -> np.ndarray:
    """Six directions at right angles in as many columns of the photo as it is stored, of different lengths."""
    height, width = size
    found = np.zeros((NUMBERS, height, width), np.float32)
    place = np.arange(width) * NUMBERS // width
    found[place, :, np.arange(width)] = 1 + place[:, None]
    return found


def test_features_take_the_way_of_the_photo_through_crop_and_size(scene: Scene):
    """A view of 20x16 keeps 19 of 32 columns, from the seventh on. Its columns cover 19 / 16 px, so each is a mean over two directions at
    most, in the shares in which it covers their columns of 32 / 6 px."""
    views = scene.read([0, 2], (20, 16))
    found = Featuring(Made(columns))(encoding(views, (2.0, 9.0)), scene, (0, 2), views)
    assert found.compression.book is None
    features = found.compression.features(found.coordinates).view(2, 20, 16, NUMBERS)
    borders = [math.ceil(32 * k / 6) for k in range(7)]  # columns of the photo belong to one direction as a whole
    for column in range(16):
        left, right = 6 + column * 19 / 16, 6 + (column + 1) * 19 / 16
        shares = [max(0.0, min(right, b) - max(left, a)) * 16 / 19 for a, b in itertools.pairwise(borders)]
        torch.testing.assert_close(features[1, 7, column], torch.tensor(shares), rtol=0, atol=1e-5)
    assert found.kept == pytest.approx(1, abs=1e-5)
    assert found.bound < 1e-3
    assert found.notes == ()
    (note,) = replace(found, kept=0.69).notes
    assert "keeps only 69% of the energy of the features from made up" in note


def test_features_go_through_the_lens(scene: Scene):
    """The undistorted map has the feature of the stored pixel that the undistortion map names, by bilinear interpolation."""
    lens = replace(scene.frames[0].lens, distortion=(-0.25, 0.05, 0.0, 0.01, 0.0))
    bent = replace(scene, frames=tuple(replace(frame, lens=lens) for frame in scene.frames))
    views = bent.read([0, 1], (24, 32))
    found = Featuring(Made(columns))(encoding(views, (2.0, 9.0)), bent, (0, 1), views)
    features = found.compression.features(found.coordinates).view(2, 24, 32, NUMBERS)
    x, y = lens.maps()
    stored = columns("", (24, 32)) / np.maximum(columns("", (24, 32)).sum(0), 1e-9)
    moved = 0
    for row, column in itertools.product(range(24), range(32)):
        u, v = float(x[row, column]), float(y[row, column])
        corners = itertools.product((math.floor(u), math.floor(u) + 1), (math.floor(v), math.floor(v) + 1))
        expected = sum(
            (1 - abs(u - a)) * (1 - abs(v - b)) * stored[:, min(max(b, 0), 23), min(max(a, 0), 31)] for a, b in corners
        )
        found_here = features[0, row, column].numpy()
        assert np.abs(found_here - expected).max() < 0.05  # OpenCV's weights are multiples of 1 / 32
        moved += int(np.abs(found_here - stored[:, row, column]).max() > 0.3)
    assert moved > 20, "the lens moves some"


@pytest.mark.parametrize(("depth", "together"), [(3.0, True), (6.0, False)])
def test_views_that_agree_in_depth_share_their_mean(scene: Scene, depth: float, together: bool):
    """Two views from one place; the first sees direction 0 and the second direction 1 everywhere."""
    frames = (scene.frames[0], replace(scene.frames[0], name="images/other.jpg"))
    twice = replace(scene, frames=frames)
    views = twice.read([0, 1], (24, 32))

    def make(name: str, size: tuple[int, int]) -> np.ndarray:
        values = np.zeros((NUMBERS, 3, 4), np.float16)
        values[int("other" in name)] = 7
        return values

    found = Featuring(Made(make))(encoding(views, (3.0, depth), stride=2), twice, (0, 1), views)
    features = found.compression.features(found.coordinates).view(2, 12, 16, NUMBERS)[0, 5, 7]
    expected = [0.5, 0.5] if together else [1.0, 0.0]
    torch.testing.assert_close(features, torch.tensor([*expected, 0, 0, 0, 0]), rtol=0, atol=1e-5)
    axis = torch.eye(NUMBERS)[0]
    cosine = found.similarity(axis).view(2, 12, 16)[0, 5, 7]
    assert float(cosine) == pytest.approx(math.sqrt(0.5) if together else 1, abs=1e-5)


def test_pixels_without_a_feature_have_no_similarity(scene: Scene):
    def make(name: str, size: tuple[int, int]) -> np.ndarray:
        values = np.random.default_rng(5).normal(size=(NUMBERS, 6, 8))
        values[:, :, 4:] = 0
        return values

    views = scene.read([0, 1], (24, 32))
    found = Featuring(Made(make))(encoding(views, (2.0, 9.0)), scene, (0, 1), views)
    missing = found.similarity(torch.ones(NUMBERS)).view(2, 24, 32).isnan()
    assert missing[:, :, 18:].all()
    assert not missing[:, :, :14].any()


def test_what_is_kept_and_the_bound_are_worked_out_by_hand():
    """(0, 0.6, 0.8) loses 0.64 of the energy about the mean (1, 1.6, 0.8) / 3, which is 3 - 4.2 / 3 = 1.6. It becomes (0, 1, 0), which is
    sqrt(0.16 + 0.64) away. The zero counts nowhere."""
    tally = _Tally(Compression(torch.eye(3)[:, :2]))
    found = tally.add(torch.tensor([[1.0, 0, 0], [0, 1, 0]]))
    tally.add(torch.tensor([[0.0, 0, 0], [0, 0.6, 0.8]]))
    assert found.tolist() == [[1, 0], [0, 1]]
    assert tally.kept == pytest.approx(1 - 0.64 / 1.6, abs=1e-6)
    assert tally.bound == pytest.approx(math.sqrt(0.8), abs=1e-6)


def test_no_embedding_deviates_more_than_the_bound(scene: Scene):
    generator = np.random.default_rng(1)
    bases = generator.normal(size=(60, 90))

    def make(name: str, size: tuple[int, int]) -> np.ndarray:
        shares = generator.normal(size=(12, 16, 60)) / np.arange(1, 61)
        return np.moveaxis(shares @ bases, -1, 0)

    views = scene.read([0, 1], (24, 32))
    found = Featuring(Made(make))(encoding(views, (2.0, 9.0)), scene, (0, 1), views)
    assert found.compression.basis.shape == (90, 32)
    assert 0.9 < found.kept < 0.99999
    assert len(found.sample) == 2 * 12 * 16
    torch.testing.assert_close(found.sample.norm(dim=1), torch.ones(384))
    compression = found.compression
    for seed in range(4):
        embedding = torch.randn(90, generator=torch.Generator().manual_seed(seed))
        exact = torch.nn.functional.cosine_similarity(found.sample, embedding[None], dim=1)
        again = compression.features(compression.coordinates(found.sample))
        changed = (torch.nn.functional.cosine_similarity(again, embedding[None], dim=1) - exact).abs().max()
        assert found.deviation(embedding) == pytest.approx(float(changed), abs=1e-6)
        assert 0 < found.deviation(embedding) < found.bound


def test_features_of_any_float_type_and_length_become_units():
    values = np.array([[[3.0, 0.0, 1e-30]], [[4.0, 0.0, 0.0]]])
    (found,) = unit_features(values)
    torch.testing.assert_close(found, torch.tensor([[0.6, 0.8], [0, 0], [1, 0]]))
    (half,) = unit_features(np.array([[[60000.0]], [[60000.0]]], np.float16))
    torch.testing.assert_close(half, torch.full((1, 2), math.sqrt(0.5)))


def test_a_sample_is_spread_over_all_places():
    assert _spread(5, 9).tolist() == [0, 1, 2, 3, 4]
    chosen = _spread(10_000, 100)
    assert len(chosen) == 100
    assert np.diff(chosen).max() < 200
    assert len(np.unique(chosen % 100)) > 50, "not one column of a map"


@pytest.mark.parametrize("with_book", [False, True])
def test_saved_features_are_read_as_they_were(tmp_path: Path, with_book: bool):
    codes = torch.tensor([2, 0, 1, 1], dtype=torch.uint8) if with_book else torch.randn(4, 2)
    book = torch.tensor([[0.0, 0], [1, 0], [0, 1]]) if with_book else None
    features = SceneFeatures(Compression(torch.eye(3)[:, :2], book), codes, 0.75, 0.125, torch.eye(3), "clip")
    save_features(tmp_path / "features.safetensors", features)
    found = load_features(tmp_path)
    assert torch.equal(found.codes, codes)
    assert torch.equal(found.coordinates, features.coordinates)
    assert torch.equal(found.sample, features.sample)
    assert (found.kept, found.bound, found.source, found.numbers) == (0.75, 0.125, "clip", 3)
    with pytest.raises(InputError, match=r"expected features of a scene, found no such file; give the folder"):
        load_features(tmp_path / "elsewhere")
    broken = replace(features, codes=codes[:, None])
    save_features(tmp_path / "broken.safetensors", broken)
    with pytest.raises(InputError, match=r"codes of shape"):
        load_features(tmp_path / "broken.safetensors")


def saved(folder: Path, name: str, values: np.ndarray) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, values)
    return path


def test_files_are_found_like_class_maps(scene: Scene, tmp_path: Path):
    values = np.random.default_rng(0).normal(size=(5, 6, 8)).astype(np.float16)
    saved(tmp_path / "maps", "000.npy", values)
    np.savez_compressed(tmp_path / "maps" / "001.npz", features=2 * values)
    saved(tmp_path / "maps", "images/000.npy", 3 * values)
    files = FeatureFiles.opened(tmp_path / "maps", scene)
    assert np.array_equal(files.of(scene.frames[0]), 3 * values)
    assert np.array_equal(files.of(scene.frames[1]), 2 * values)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.zeros((5, 6, 8), np.int32), r"001\.npy: expected one array of features .* found \(5, 6, 8\) of int32"),
        (np.zeros((6, 8)), r"001\.npy: expected one array of features .* found \(6, 8\) of float64"),
        (np.full((5, 6, 8), np.nan), r"001\.npy: \[0\]: expected finite numbers, found NaN or infinity"),
        (np.ones((5, 8, 6)), r"001\.npy: expected the aspect of its photo, 32x24 \(width x height\), found 6x8"),
        (np.ones((5000, 3, 4)), r"001\.npy: expected features of at most 4096 numbers, found 5000"),
        (None, r"maps: expected the features of frame images/001\.jpg: images/001\.npy or images/001\.npz, found none"),
    ],
)
def test_files_that_do_not_fit_are_refused(scene: Scene, tmp_path: Path, values: np.ndarray | None, said: str):
    (tmp_path / "maps").mkdir()
    if values is not None:
        saved(tmp_path / "maps", "001.npy", values)
    with pytest.raises(InputError, match=said):
        FeatureFiles.opened(tmp_path / "maps", scene).of(scene.frames[1])


def test_a_grid_of_patches_may_have_about_the_aspect_of_its_photo(scene: Scene, tmp_path: Path):
    """32x24 has 9.14 columns for 7 rows: 9 are right, 12 are not."""
    saved(tmp_path / "maps", "001.npy", np.ones((2, 7, 9)))
    files = FeatureFiles.opened(tmp_path / "maps", scene)
    assert files.of(scene.frames[1]).shape == (2, 7, 9)
    saved(tmp_path / "maps", "001.npy", np.ones((2, 7, 12)))
    with pytest.raises(InputError, match="the aspect of its photo"):
        files.of(scene.frames[1])


@pytest.mark.parametrize(
    ("numbers", "value", "said"),
    [
        ((5, 4), 1.0, r"made up: images/001\.jpg: expected features of 5 numbers, as of images/000\.jpg, found 4"),
        ((5, 5), 0.0, r"made up: expected features, found zeros only"),
    ],
)
def test_features_that_do_not_fit_together_are_refused(scene: Scene, numbers: tuple[int, int], value: float, said: str):
    def make(name: str, size: tuple[int, int]) -> np.ndarray:
        return np.full((numbers[int("001" in name)], 3, 4), value)

    views = scene.read([0, 1], (24, 32))
    with pytest.raises(InputError, match=said):
        Featuring(Made(make))(encoding(views, (2.0, 9.0)), scene, (0, 1), views)
