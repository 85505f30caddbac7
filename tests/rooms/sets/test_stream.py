import numpy as np
import pytest
import torch

pytest.importorskip("embreex")

from semgs.data.tables.classes import IGNORE
from semgs.geometry.cameras import back_project, project
from semgs_rooms.drawing.room import build_room
from semgs_rooms.drawing.shading import look, pixel_directions
from semgs_rooms.sets.room_stream import RoomSamples, generator, sample

SIZE = (48, 64)


@pytest.fixture(scope="module")
def twenty():
    return [sample(4, k, size=SIZE, contexts=2, targets=1) for k in range(20)]


@pytest.fixture(scope="module")
def sixty(twenty):
    return twenty + [sample(4, k, size=SIZE, contexts=2, targets=1) for k in range(20, 60)]


def test_the_same_seed_and_index_give_the_same_bits_whatever_was_drawn_before():
    first = sample(9, 3, size=SIZE, contexts=2, targets=2)
    sample(9, 8, size=(40, 30), contexts=1, targets=0)
    again = sample(9, 3, size=SIZE, contexts=2, targets=2)
    for one, other in zip(first, again, strict=True):
        assert torch.equal(one.images, other.images)
        assert torch.equal(one.labels, other.labels)
        assert torch.equal(one.depths, other.depths)
        assert torch.equal(one.cameras.world_from_camera, other.cameras.world_from_camera)
        assert torch.equal(one.cameras.intrinsics, other.cameras.intrinsics)


def test_another_index_or_seed_is_another_room():
    context = sample(4, 0, size=SIZE, contexts=2, targets=1)[0]
    for seed, index in ((4, 1), (5, 0)):
        other = sample(seed, index, size=SIZE, contexts=2, targets=1)[0]
        assert not torch.equal(context.images, other.images)
        assert not torch.allclose(context.depths, other.depths)


@pytest.mark.long
def test_all_twenty_classes_occur_in_sixty_rooms_and_no_other_label(sixty):
    labels = torch.cat([views.labels.flatten() for pair in sixty for views in pair])
    assert set(labels.unique().tolist()) == {*range(20), IGNORE}
    shares = torch.bincount(labels.long(), minlength=256)[:20] / len(labels)
    assert shares[0] < 0.5
    assert shares.min() > 5e-4


@pytest.mark.long
def test_depths_are_those_of_a_room_and_every_pixel_has_one(sixty):
    depths = torch.cat([views.depths.flatten() for pair in sixty for views in pair])
    assert (depths > 0).float().mean() > 0.99999
    assert depths.max() < 10
    assert depths[depths > 0].min() > 0.2


@pytest.mark.long
def test_what_one_view_sees_lies_within_5_mm_on_the_surface_that_another_sees(twenty):
    """From the second camera, a ray to a point of the first view ends at that point, or before it on what hides it."""
    shown = []
    for index, (context, _) in enumerate(twenty):
        room = build_room(generator(4, index))
        points = back_project(context.depths.double(), context.cameras)[0].reshape(-1, 3)
        pixels = project(points, context.cameras[1])
        x, y, z = pixels.unbind(-1)
        inside = ((z > 0.1) & (x > 0) & (y > 0) & (x < SIZE[1]) & (y < SIZE[0])).numpy()
        pose = context.cameras.world_from_camera[1].numpy()
        intrinsics = context.cameras.intrinsics[1].numpy()
        labels, depths = look(room, pose, pixel_directions(pose, intrinsics, pixels[:, :2].numpy()[inside]))
        gap = z.numpy()[inside] - depths
        assert gap.min() > -0.001
        near = np.abs(gap) < 0.005
        assert (labels == context.labels[0].flatten().numpy()[inside])[near].mean() > 0.99
        shown.append(near.mean())
    assert min(shown) > 0.5
    assert np.mean(shown) > 0.85


@pytest.mark.long
def test_neighbouring_contexts_share_most_of_what_they_see(sixty):
    shares = []
    for context, _ in sixty:
        points = back_project(context.depths.double(), context.cameras)[0].reshape(-1, 3)
        x, y, z = project(points, context.cameras[1]).unbind(-1)
        shares.append(((z > 0) & (x > 0) & (y > 0) & (x < SIZE[1]) & (y < SIZE[0])).double().mean())
    assert np.quantile(shares, 0.05) > 0.25  # a third of the cameras takes long steps
    assert np.median(shares) > 0.65


@pytest.mark.long
def test_cameras_move_by_hand_and_are_never_alike(sixty):
    steps = [float((c.cameras.centres[1] - c.cameras.centres[0]).norm()) for c, _ in sixty]
    assert min(steps) > 0.01
    assert 0.08 < np.median(steps) < 0.5
    heights = [float(c.cameras.centres[0, 2]) for c, _ in sixty]
    assert 0.3 < min(heights) < 0.6 < 1.3 < max(heights) < 2.0  # robots and people
    centres = torch.stack([c.cameras.intrinsics[0, :2, 2] for c, _ in sixty])
    assert (centres - torch.tensor([32.0, 24.0])).abs().amin() > 0
    ratio = torch.stack([c.cameras.focal_px[0, 0] / c.cameras.focal_px[0, 1] for c, _ in sixty])
    assert ratio.max() > 1.1
    assert ratio.min() < 0.9
    assert ratio.max() < 4 / 3 + 0.02


def test_portraits_are_drawn_as_well():
    context, target = sample(1, 2, size=(64, 48), contexts=3, targets=2)
    assert context.size == target.size == (64, 48)
    assert (len(context), len(target)) == (3, 2)
    assert context.depth_range.tolist() == [[0.5, 10.0]] * 3


def test_no_targets_are_no_views():
    context, target = sample(1, 2, size=(12, 16), contexts=2, targets=0)
    assert (len(context), len(target)) == (2, 0)


def test_items_of_a_group_have_equal_counts_and_groups_differ():
    rooms = RoomSamples(seed=6, size=(12, 16), contexts=(2, 4), targets=(1, 2), length=30, group=3)
    counts = [rooms.counts(k) for k in range(30)]
    assert all(len(set(counts[start : start + 3])) == 1 for start in range(0, 30, 3))
    assert {context for context, _ in counts} == {2, 3, 4}
    assert {target for _, target in counts} == {1, 2}
    assert tuple(len(views) for views in rooms[29]) == counts[29]
    assert len(rooms) == 30
    with pytest.raises(IndexError):
        rooms[30]


@pytest.mark.parametrize(
    ("seed", "index", "named"),
    [(-1, 0, {}), (0, -1, {}), (0, 0, {"contexts": 0}), (0, 0, {"targets": -1}), (0, 0, {"size": (0, 8)})],
)
def test_samples_that_cannot_be_are_refused(seed, index, named):
    with pytest.raises(ValueError, match="expected"):
        sample(seed, index, **{"size": (8, 12), "contexts": 2, "targets": 1, **named})
