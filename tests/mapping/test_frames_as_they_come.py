"""Streams: frames in, a growing scene out."""

from __future__ import annotations

import gc
import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import torch
from mapping_walls import INTRINSICS, SIZE, WALL, KnowsTheWall, image, pose

import semgs
from semgs.data.bounds.depth_range import DepthRange
from semgs.mapping.mapper import MOST_KEYFRAMES, Mapper


def walk(count: int, step: float = 0.3) -> list[tuple]:
    """Frames along the wall."""
    return [(image(), pose(step * number), INTRINSICS) for number in range(count)]


def streamed(frames, **options) -> list:
    """All scenes of a stream."""
    return list(semgs.stream(frames, KnowsTheWall(), size=SIZE, **options))


def test_no_frame_is_read_before_the_one_before_it_was_dealt_with():
    """The generator counts what was taken from it: when the scene of frame n comes, that is n + 1."""
    taken = 0

    def frames() -> Iterator[tuple]:
        nonlocal taken
        for frame in walk(12):
            taken += 1
            yield frame

    scenes = 0
    for scene in semgs.stream(frames(), KnowsTheWall(), size=SIZE):
        assert taken == scene.frame + 1
        scenes += 1
    assert scenes >= 3
    assert taken == 12


def test_colours_turned_round_as_from_bgr_are_read():
    def bgr(frame: tuple) -> tuple:
        rgb = (255 * frame[0].permute(1, 2, 0)).round().byte().numpy()
        return (np.ascontiguousarray(rgb[..., ::-1])[..., ::-1], *frame[1:])

    assert len(streamed(map(bgr, walk(8)))) == len(streamed(walk(8)))


def test_the_scene_grows_along_the_wall_and_lies_on_it():
    scenes = streamed(walk(12))
    assert [scene.frame for scene in scenes] == sorted({scene.frame for scene in scenes})
    means = [scene.gaussians.means for scene in scenes]
    for one in means:
        torch.testing.assert_close(one[:, 2], torch.full((len(one),), WALL))
    assert means[-1][:, 0].max() > means[0][:, 0].max() + 1.5
    rendering = semgs.render(scenes[-1].gaussians, scenes[-1].views.cameras)
    assert rendering.alphas.mean() > 0.5
    assert scenes[-1].saved.frames == scenes[-1].names


def test_gaussians_keep_their_sources_while_the_scene_grows():
    """Each has another; those that two scenes share are in the same place of the wall. Photos differ, as those of a camera do."""
    before, after = streamed([(image(0.5 + 0.02 * k), *frame[1:]) for k, frame in enumerate(walk(12))], voxel=None)[-2:]
    for scene in (before, after):
        assert len(scene.sources.unique()) == len(scene.gaussians) == len(scene.sources)
    shared = set(before.sources.tolist()) & set(after.sources.tolist())
    assert len(shared) > len(before.sources) / 2
    places = [dict(zip(one.sources.tolist(), one.gaussians.means, strict=True)) for one in (before, after)]
    for source in sorted(shared)[::50]:
        torch.testing.assert_close(places[0][source], places[1][source])


def test_frames_that_cannot_be_used_are_counted_and_the_walk_goes_on():
    frames = [(*frame, float(number)) for number, frame in enumerate(walk(14))]
    broken = frames[8][1].clone()
    broken[0, 0] = math.nan
    jumped = frames[9][1].clone()
    jumped[0, 3] += 40
    frames[5] = (image(0.01), *frames[5][1:])
    frames[6] = (torch.full((3, *SIZE), 0.5), *frames[6][1:])
    frames[7] = (*frames[7][:3], 2.0)
    frames[8] = (frames[8][0], broken, *frames[8][2:])
    frames[9] = (frames[9][0], jumped, *frames[9][2:])
    scene = streamed(frames)[-1]
    assert dict(scene.ignored) == {
        "its image is black": 1,
        "its image is blank": 1,
        "its time is not later than the one before": 1,
        "its image, pose or intrinsics are not valid": 1,
        "its pose jumps": 1,
    }
    assert scene.frame >= 11


def test_a_recording_that_is_played_again_costs_one_frame():
    times = [10.0, 11.0, 12.0, 13.0, 1.0, 2.0, math.nan, 3.0, 4.0]
    frames = [(*frame, time) for frame, time in zip(walk(9), times, strict=True)]
    scene = streamed(frames)[-1]
    assert dict(scene.ignored) == {"its time is not later than the one before": 2}  # 1 and what is no number
    assert "8" in scene.names[-1]


def test_a_camera_that_was_really_moved_costs_one_frame():
    frames = [*walk(8), *[(image(), pose(50 + 0.3 * number), INTRINSICS) for number in range(6)]]
    scene = streamed(frames)[-1]
    assert dict(scene.ignored) == {"its pose jumps": 1}
    assert scene.gaussians.means[:, 0].max() > 45


def test_a_camera_that_changes_its_size_is_resized_and_counted():
    frames = walk(10)
    large = torch.diag(torch.tensor([2.0, 2.0, 1.0], dtype=torch.float64)) @ INTRINSICS
    frames[4:] = [(image(size=(2 * SIZE[0], 2 * SIZE[1])), one, large) for _, one, _ in frames[4:]]
    scene = streamed(frames)[-1]
    assert scene.resized == scene.frame + 1 - 4
    torch.testing.assert_close(scene.gaussians.means[:, 2], torch.full((len(scene.gaussians),), WALL))


@pytest.mark.parametrize(
    "frames",
    [
        [],
        walk(1),
        [(image(), pose(100.0 * number), INTRINSICS) for number in range(4)],
        [(image(0.0), pose(0.3 * number), INTRINSICS) for number in range(3)],
    ],
    ids=["nothing", "one frame", "no overlap", "black"],
)
def test_a_recording_with_nothing_usable_gives_no_scene(frames):
    assert streamed(frames) == []


def test_frames_of_which_none_is_valid_are_an_error_with_the_counted_reasons():
    """Intrinsics that are divided by the image size, as some programs have them; one frame of four comes twice."""
    divided = INTRINSICS / torch.tensor([[SIZE[1]], [SIZE[0]], [1.0]])
    frames = [(image(), pose(0.3 * number), divided, float(max(number, 1))) for number in range(4)]
    said = r"no frame could be used: its image, pose or intrinsics are not valid \(3\), its time is not later than the one before \(1\); the first: .*intrinsics"
    with pytest.raises(ValueError, match=said):
        streamed(frames)


@pytest.mark.parametrize(
    ("time", "named"), [(None, "None (NoneType)"), ("12:30", "'12:30' (str)"), ([1, 2], "[1, 2] (list)")]
)
def test_a_time_that_is_no_number_is_named(time: object, named: str):
    """Such as the stamp of a message, which has seconds and nanoseconds. Python's own error said nothing of frames."""
    frame = (image(0.0), pose(0.0), INTRINSICS, time)
    with pytest.raises(TypeError, match=re.escape(f"a frame's time is {named}; expected seconds")):
        next(semgs.stream([frame], KnowsTheWall()))


def test_a_frame_needs_three_or_four_parts():
    with pytest.raises(ValueError, match="a frame has 2 parts"):
        streamed([(image(), pose(0.0))])


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"views": 5}, "2 to 4 views"),
        ({"radius": 0.0}, "radius is 0"),
        ({"voxel": -1.0}, "voxel is -1"),
        ({"depth_range": (10.0, 0.5)}, r"depth_range is \(10.0, 0.5\); expected .* 0 < near < far"),
        ({"depth_range": (0.0, 10.0)}, "0 < near < far"),
        ({"depth_range": (0.5, math.inf)}, "0 < near < far"),
    ],
)
def test_numbers_outside_their_range_are_refused(options, said):
    with pytest.raises(ValueError, match=said):
        streamed(walk(2), **options)


def test_memory_is_that_of_the_radius_forty_frames_there_and_back():
    """Within 2 m of the camera there is always the same: Gaussians stay within the radius, and their number stays."""
    places = [0.3 * number for number in range(20)]
    frames = [(image(), pose(x), INTRINSICS) for x in [*places, *places[::-1]]]
    counts = []
    for scene in semgs.stream(frames, KnowsTheWall(), size=SIZE, radius=5.0):
        centre = scene.views.cameras.centres[[scene.names.index(str(scene.frame))]].float()
        assert (scene.gaussians.means - centre).norm(dim=-1).max() <= 5.0 + 1e-3
        counts.append(len(scene.gaussians))
    everything = len(streamed(frames)[-1].gaussians)
    assert max(counts) < 0.7 * everything


def test_a_radius_that_nothing_is_within_is_an_error_once_the_frames_have_ended():
    """The wall is at a depth of `WALL`, so all of it is farther than half of that from every keyframe. It is no error while frames come."""
    with pytest.raises(ValueError, match=f"radius is {WALL / 2}; expected more, or None: everything was farther"):
        streamed(walk(4), radius=WALL / 2)
    assert streamed(walk(1), radius=WALL / 2) == []


def test_with_a_radius_there_are_never_more_keyframes_than_the_limit(monkeypatch):
    monkeypatch.setattr("semgs.mapping.mapper.MOST_KEYFRAMES", 3)
    assert MOST_KEYFRAMES == 64
    scenes = streamed(walk(20), radius=100.0)
    assert max(len(scene.names) for scene in scenes) == 3


def resident_mb() -> float:
    """Memory of this process [MB]."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * 4096 / 1e6


@pytest.mark.long
@pytest.mark.timeout(900)
def test_five_thousand_frames_hold_memory_flat():
    """A robot that patrols 8 m along a wall, at 96x128 with the included weights: memory after frame 500 and after frame 5,000, within 2 %."""
    size = (96, 128)
    intrinsics = torch.tensor([[110.0, 0, 63.0], [0, 110, 47.5], [0, 0, 1]], dtype=torch.float64)
    rng = np.random.default_rng(3)
    walls = torch.from_numpy(rng.random((3, 96, 1600))).float()
    smooth = torch.nn.functional.avg_pool2d(walls[None], 5, 1, 2)[0]
    after: dict[int, float] = {}

    def frames() -> Iterator[tuple]:
        for number in range(5000):
            if number in (500, 4999):
                after[number] = resident_mb()
            along = 8 * (1 - abs((number % 1000) / 500 - 1))
            start = round(along * 110 / 4)
            yield smooth[:, :, start : start + 128].clone(), pose(along), intrinsics

    model = semgs.load("small")
    scenes = sum(1 for _ in semgs.stream(frames(), model, size=size, radius=5.0))
    assert scenes > 50
    assert after[4999] == pytest.approx(after[500], rel=0.02)


def test_the_mapper_names_keyframes_that_never_found_a_partner():
    mapper = Mapper(lambda _, views: KnowsTheWall()(views), DepthRange(0.5, 10.0, "metric", "given"))
    for number, (_, where, _) in enumerate([walk(1)[0], (image(), pose(0.0, yaw=math.pi), INTRINSICS)]):
        view = semgs.Views.from_arrays([image()], [where], INTRINSICS, (0.5, 10.0))
        mapper.add(view, f"frame {number}")
    assert mapper.alone == ("frame 0", "frame 1")
    assert mapper.merged() is None
