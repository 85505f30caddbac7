import pytest
import torch

pytest.importorskip("embreex")

from semgs_rooms.sets import pool
from semgs_rooms.sets.pool import PooledSamples
from semgs_rooms.sets.room_scenes import RoomSettings, draw_scene
from semgs_rooms.sets.room_stream import RoomSamples

SIZE = (24, 32)


def same(one, other) -> bool:
    return all(
        torch.equal(a.images, b.images) and torch.equal(a.labels, b.labels) and torch.equal(a.depths, b.depths)
        for a, b in zip(one, other, strict=True)
    )


def test_a_sample_is_the_same_whatever_the_pool_holds(tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "WINDOW", 3)
    monkeypatch.setattr(pool, "FRAMES", 6)
    first = PooledSamples(tmp_path / "one", RoomSamples(5, SIZE, (2, 3), 2, length=20), served=4)
    other = PooledSamples(tmp_path / "two", RoomSamples(5, SIZE, (2, 3), 2, length=20), served=4)
    expected = [first[k] for k in range(4)]
    assert same(other[3], expected[3])
    assert same(other[0], expected[0])
    assert same(first[2], expected[2])


def test_a_sample_shows_frames_of_its_scene(tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "WINDOW", 2)
    monkeypatch.setattr(pool, "FRAMES", 6)
    samples = PooledSamples(tmp_path, RoomSamples(5, SIZE, 2, 1, length=9))
    monkeypatch.setattr(
        "semgs.data.bounds.depth_range.find_features", lambda frame: pytest.fail("too slow for samples")
    )
    scene, contexts, targets = samples.choice(8)
    context, target = samples[8]
    views = draw_scene(RoomSettings(5, SIZE, pool.FRAMES), scene).views
    assert torch.equal(context.labels, views.labels[contexts])
    assert torch.equal(target.labels, views.labels[targets])
    assert torch.equal(context.depth_range, views.depth_range[contexts])


def test_every_scene_serves_the_samples_that_were_asked_for_on_average_and_frames_are_never_both_context_and_target():
    samples = PooledSamples("unused", RoomSamples(7, SIZE, (1, 4), (0, 3), length=2000, group=2), served=8)
    scenes = []
    for k in range(2000):
        scene, contexts, targets = samples.choice(k)
        scenes.append(scene)
        assert k // 8 <= scene < k // 8 + pool.WINDOW
        assert len({*contexts, *targets}) == len(contexts) + len(targets)
        assert all(0 <= frame < pool.FRAMES for frame in (*contexts, *targets))
        _, partner, others = samples.choice(k ^ 1)
        assert (len(contexts), len(targets)) == (len(partner), len(others))
    inner = [scenes.count(index) for index in range(pool.WINDOW, 200)]
    assert sum(inner) / len(inner) == pytest.approx(8, abs=0.5)


def test_scenes_that_the_window_has_passed_are_removed(tmp_path, monkeypatch):
    monkeypatch.setattr(pool, "WINDOW", 1)
    monkeypatch.setattr(pool, "FRAMES", 2)
    samples = PooledSamples(tmp_path, RoomSamples(5, (12, 16), 2, 0, length=6), served=1)
    for k in range(6):
        samples[k]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene_00004", "scene_00005"]


def test_scenes_of_samples_that_a_slow_worker_may_still_read_are_kept(tmp_path, monkeypatch):
    # Sample 11 moves the window of two scenes to 11 and 12; sample 4, whose scenes are 4 and 5, is still being read.
    monkeypatch.setattr(pool, "WINDOW", 2)
    monkeypatch.setattr(pool, "FRAMES", 2)
    samples = PooledSamples(tmp_path, RoomSamples(5, (12, 16), 2, 0, length=12), served=1, ahead=7)
    for index in range(11):
        (tmp_path / f"scene_{index:05d}").mkdir()
    samples[11]
    left = {int(path.name[-5:]) for path in tmp_path.iterdir()}
    assert {4, 5, 6, 7, 8, 9, 10} <= left
    assert not {0, 1, 2, 3} & left


@pytest.mark.parametrize("named", [{"served": 0}, {"length": 0}, {"contexts": (2, 12)}])
def test_pools_that_cannot_be_are_refused(named):
    served = named.get("served", 8)
    named = {key: value for key, value in named.items() if key != "served"}
    with pytest.raises(ValueError, match="expected"):
        PooledSamples("unused", RoomSamples(1, SIZE, **{"contexts": 2, "targets": 1, "length": 3, **named}), served)
