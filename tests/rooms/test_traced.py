"""Rooms by path tracing: what holds without Mitsuba, one frame with it, and under `long` what it is worth."""

import json
import sys
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs.cli.main import main
from semgs.rooms import denoiser, mitsuba_scene
from semgs.rooms.cameras import draw_intrinsics, draw_path
from semgs.rooms.dataset import Recipe, write_dataset
from semgs.rooms.room import Room, build_room
from semgs.rooms.shading import Frame, photograph
from semgs.rooms.stream import fitted, generator, render_of
from semgs.rooms.traced import check_installed, trace

SIZE = (48, 64)


@pytest.fixture
def tracer() -> None:
    """The test is skipped where the extra `rooms` is not installed."""
    try:
        check_installed()
    except ImportError as error:
        pytest.skip(str(error))


@pytest.fixture
def shaded_instead(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is to be traced is shaded, so that no tracer is needed."""
    monkeypatch.setattr(
        "semgs.rooms.stream.trace",
        lambda room, poses, intrinsics, size, seeds: [photograph(room, pose, intrinsics, size) for pose in poses],
    )


def tree(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("render", ["traced", "mixed"])
@pytest.mark.parametrize("missing", ["mitsuba", "pyoidn"])
def test_without_the_extra_one_line_names_it_and_nothing_is_written(missing, render, tmp_path, capsys, monkeypatch):
    if missing == "mitsuba":
        mitsuba_scene.library.cache_clear()
    else:
        monkeypatch.setattr(mitsuba_scene, "library", lambda: None)
        denoiser.device.cache_clear()
    monkeypatch.setitem(sys.modules, missing, None)
    assert main(["rooms", str(tmp_path / "out"), "--render", render, "--scenes", "1"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert missing in told
    assert "pip install '.[rooms]' in SemGS's folder" in told
    assert not (tmp_path / "out").exists()


def test_one_mixed_scene_in_ten_is_traced_by_seed_and_number_alone():
    picked = {seed: [k for k in range(3000) if render_of("mixed", seed, k) == "traced"] for seed in (0, 1)}
    assert all(240 < len(numbers) < 360 for numbers in picked.values())
    assert picked[0] != picked[1]
    assert picked[0][:5] == [11, 28, 30, 35, 38]  # for ever
    assert [render_of("shaded", 0, 11), render_of("traced", 0, 0)] == ["shaded", "traced"]


def test_a_data_set_tells_how_it_and_each_of_its_scenes_are_lit(shaded_instead, tmp_path):
    """However many scenes there are; a folder that is lit otherwise is not added to."""
    recipe = Recipe(seed=1, size=(12, 16), frames=2, render="mixed")
    expected = [render_of("mixed", 1, k) for k in range(4)]
    assert set(expected) == {"shaded", "traced"}
    for scenes in (2, 4):
        index = write_dataset(tmp_path / "rooms", recipe, scenes)
        assert json.loads((tmp_path / "rooms" / "settings.json").read_text())["render"] == "mixed"
        assert [scene["render"] for scene in index["scenes"]] == expected[:scenes]
        for number in range(scenes):
            room = json.loads((tmp_path / "rooms" / f"scene_{number:05d}" / "room.json").read_text())
            assert room["render"] == expected[number]
    with pytest.raises(ValueError, match="render is mixed there, shaded asked"):
        write_dataset(tmp_path / "rooms", Recipe(seed=1, size=(12, 16), frames=2), 4)


def test_a_traced_frame_has_the_labels_and_depths_of_the_shaded_one_and_other_light(tracer):
    room, pose, intrinsics = view(0, (24, 32))
    (traced,) = trace(room, [pose], intrinsics, (24, 32), [5])
    (again,) = trace(room, [pose], intrinsics, (24, 32), [5])
    shaded = photograph(room, pose, intrinsics, (24, 32))
    assert (traced.labels == shaded.labels).all()
    assert (traced.depths == shaded.depths).all()
    assert (traced.radiance == again.radiance).all()
    assert np.isfinite(traced.radiance).all()
    assert traced.radiance.min() >= 0
    assert not np.allclose(traced.radiance, shaded.radiance, rtol=0.02)


def view(index: int, size: tuple[int, int]) -> tuple[Room, np.ndarray, np.ndarray]:
    """A room, a pose in it and intrinsics."""
    rng = generator(5, index)
    room = build_room(rng)
    intrinsics = draw_intrinsics(rng, size)
    path = fitted(rng, room, draw_path(rng, room, intrinsics, size, 1.0), intrinsics, size)
    return room, path.pose(0.0), intrinsics


def both(count: int, size: tuple[int, int]) -> list[tuple[Frame, Frame]]:
    """Frames of rooms, traced and shaded."""
    pairs = []
    for index in range(count):
        room, pose, intrinsics = view(index, size)
        pairs.append((trace(room, [pose], intrinsics, size, [index])[0], photograph(room, pose, intrinsics, size)))
    return pairs


def luminance(frame: Frame) -> np.ndarray:
    return frame.radiance.astype(float) @ (0.2126, 0.7152, 0.0722)


@pytest.fixture(scope="module")
def pairs() -> list[tuple[Frame, Frame]]:
    return both(12, (96, 128))


@pytest.mark.long
def test_traced_data_sets_are_the_same_bytes_twice_and_whatever_the_workers(tracer, tmp_path):
    recipe = Recipe(seed=11, size=SIZE, frames=2, render="traced")
    for name, workers in (("one", 0), ("two", 0), ("three", 2)):
        write_dataset(tmp_path / name, recipe, 2, workers=workers)
    assert tree(tmp_path / "one") == tree(tmp_path / "two") == tree(tmp_path / "three")


@pytest.mark.long
def test_tracing_changes_the_pictures_of_a_data_set_and_nothing_else(tracer, tmp_path):
    for render in ("traced", "shaded"):
        write_dataset(tmp_path / render, Recipe(seed=11, size=SIZE, frames=2, render=render), 2)
    traced, shaded = tree(tmp_path / "traced"), tree(tmp_path / "shaded")
    assert traced.keys() == shaded.keys()
    differing = {name for name in traced if traced[name] != shaded[name]}
    told = {"settings.json", "index.json", "scene_00000/room.json", "scene_00001/room.json"}
    assert differing == told | {name for name in traced if "/images/" in name}
    for name in told:
        assert traced[name].replace(b'"traced"', b'"shaded"') == shaded[name]


@pytest.mark.long
def test_traced_rooms_are_as_bright_as_shaded_ones(tracer, pairs):
    """In the median of rooms within a factor of 1.25, and none beyond 4."""
    ratios = np.array([luminance(traced).mean() / luminance(shaded).mean() for traced, shaded in pairs])
    print(f"brightness traced / shaded: {np.round(np.sort(ratios), 2)}")
    assert 0.8 < np.median(ratios) < 1.25
    assert ratios.min() > 0.25
    assert ratios.max() < 4


def steps(values: np.ndarray, axis: int) -> np.ndarray:
    """Differences of the neighbours on either side, in the middle of the picture's rows or columns."""
    return np.abs(np.roll(values, -1, axis) - np.roll(values, 1, axis))[4:-4, 4:-4]


def offset(frames: list[Frame], axis: int) -> float:
    """How far the edges of pictures lie beside those of their labels along an axis [px]: the peak of the correlation."""

    def correlation(shift: int) -> float:
        total = 0.0
        for frame in frames:
            bright = np.log(luminance(frame) + 1e-3)
            edges = steps(np.roll(frame.labels, shift, axis).astype(int), axis) > 0
            moved = np.minimum(steps(bright, axis), 1.0)
            total += ((moved - moved.mean()) * (edges - edges.mean())).sum()
        return total

    values = [correlation(shift) for shift in range(-3, 4)]
    peak = int(np.argmax(values))
    assert 0 < peak < 6
    before, here, after = values[peak - 1 : peak + 2]
    return peak - 3 + (before - after) / (2 * (before - 2 * here + after))


@pytest.mark.long
@pytest.mark.parametrize("axis", [0, 1])
def test_edges_of_traced_pictures_lie_on_those_of_labels(tracer, pairs, axis):
    traced, shaded = (offset(list(frames), axis) for frames in zip(*pairs, strict=True))
    print(f"edges beside labels along axis {axis}: traced {traced:+.3f} px, shaded {shaded:+.3f} px")
    assert abs(traced) < 0.5
    assert abs(traced - shaded) < 0.25


@pytest.mark.long
def test_a_traced_frame_of_240x320_takes_seconds(tracer):
    """4 CPU seconds are aimed at, on a core of its own; this allows for slow ones."""
    both(1, (12, 16))  # compiles
    count, spent = 3, 0.0
    for index in range(count):
        room, pose, intrinsics = view(index, (240, 320))
        start = time.process_time()
        trace(room, [pose], intrinsics, (240, 320), [index])
        spent += time.process_time() - start
    print(f"traced: {spent / count:.2f} CPU s a frame of 240x320")
    assert spent / count < 12
