"""Merging, against loops over all pairs of Gaussians and keyframes, and by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from mapping_walls import SIZE, WALL, cameras_at, encoded, seen_at

from semgs.geometry.cameras import Cameras, project
from semgs.geometry.fusion import LEAST, SPREAD, TOLERANCE
from semgs.mapping.merging import (
    LAYERS,
    REACH,
    SAME_COLOUR,
    SHARPER,
    SHRINK,
    STAY,
    STEPS,
    KeyframePart,
    Sheet,
    exposure,
    join_parts,
    parts_of,
    settle,
    unshrunk,
    votes_of,
)
from semgs.scene.encoding import Encoding


def flat(*depths: float) -> torch.Tensor:
    """Depth maps of walls."""
    return torch.stack([torch.full(SIZE, depth) for depth in depths])


def alone(encoding: Encoding, cameras: Cameras) -> list[KeyframePart]:
    """The views as keyframes 0, 1, ..., each of a window of its own."""
    found = []
    for view, part in enumerate(parts_of(encoding, seen_at(cameras), range(len(encoding.depths)))):
        own = encoded(cameras[view : view + 1], encoding.depths[view : view + 1])
        colour = replace(part.gaussians.colour, scales=own.gaussians.colour.scales)
        found.append(replace(part, gaussians=replace(part.gaussians, colour=colour)))
    return found


def merged(parts: list[KeyframePart]) -> list[KeyframePart]:
    """The parts after each has been judged by all others, added one by one."""
    kept: list[KeyframePart] = []
    for part in parts:
        new = part
        for other in kept:
            new = new.judged_by(other.sheet)
        kept = [*(other.judged_by(part.sheet) for other in kept), new]
    return kept


def photos_by_loops(part: KeyframePart, others: list[Sheet]) -> list[list[list[float]]]:
    """For each Gaussian and each depth that is tried for it, how many photos fit it and how many contradict."""
    centre = part.sheet.camera.centres
    rays, spreads = part.gaussians.means.double() - centre, part.spread.tolist()
    moves = [[REACH * (2 * step / (STEPS - 1) - 1) * (spread + SPREAD) for step in range(STEPS)] for spread in spreads]
    points = torch.stack([centre + rays * torch.tensor(moves).double()[:, [step]].exp() for step in range(STEPS)], 1)
    own = part.sheet.colours.flatten(0, 1)[part.index].tolist()
    found = [[[0.0, 0.0] for _ in range(STEPS)] for _ in own]
    for other in others:
        places, tolerance = project(points.flatten(0, 1), other.camera).tolist(), exposure(part.sheet, other)
        depths, noises, colours = other.depths.tolist(), other.spread.tolist(), other.colours.tolist()
        for number, (x, y, z) in enumerate(places):
            g, step = divmod(number, STEPS)
            if not (z > 0 and 0 <= x < SIZE[1] and 0 <= y < SIZE[0]):
                continue
            row, column = int(y), int(x)
            sigma = math.hypot(spreads[g], noises[row][column]) + SPREAD
            if math.log(z / depths[row][column]) > TOLERANCE * sigma:
                continue
            around = [
                one for line in colours[max(row - 1, 0) : row + 2] for one in line[max(column - 1, 0) : column + 2]
            ]
            beyond = max(
                max(own[g][channel] - max(values), min(values) - own[g][channel])
                for channel, values in enumerate(zip(*around, strict=True))
            )
            found[g][step][beyond > SAME_COLOUR + tolerance] += 1
    return found


def by_loops(parts: list[KeyframePart], part: KeyframePart) -> dict[int, tuple[float, list[float]]]:
    """The specification: depth ratio and class distribution of each Gaussian of a part that stays, by its place; all keyframes at once."""
    some = {}
    others = [one.sheet for one in parts if one.sheet.number != part.sheet.number]
    seen_in = [project(part.gaussians.means.double(), other.camera).tolist() for other in others]
    photos = photos_by_loops(part, others)
    for g in range(len(part)):
        agree = through = before = weight = shift = 0.0
        spread = float(part.spread[g])
        logs = [math.log(float(p) + LEAST) for p in part.gaussians.semantic.features[g]]
        for other, places in zip(others, seen_in, strict=True):
            x, y, z = places[g]
            if not (z > 0 and 0 <= x < SIZE[1] and 0 <= y < SIZE[0]):
                continue
            row, column = int(y), int(x)
            seen, noise = float(other.depths[row, column]), float(other.spread[row, column])
            sigma = math.hypot(spread, noise) + SPREAD
            around = other.depths[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
            through += math.log(z / float(around.min())) / sigma < -TOLERANCE
            if abs(math.log(z / seen)) > TOLERANCE * sigma:
                continue
            agree += 1
            sharp = math.floor(math.log(seen / other.focal_px) / math.log(SHARPER))
            before += (sharp, other.number) < (float(part.level[g]), part.sheet.number)
            weight += 1 / (noise**2 + SPREAD**2)
            shift += math.log(seen / z) / (noise**2 + SPREAD**2)
            logs = [one + float(more) for one, more in zip(logs, other.logs[row, column], strict=True)]
        if before < LAYERS:
            odds = [math.exp(one / (1 + agree)) for one in logs]
            mean = shift / (1 / (spread**2 + SPREAD**2) + weight)
            some[int(part.index[g])] = mean, spread, photos[g], through > agree, [one / sum(odds) for one in odds]
    found = {}
    for place, (mean, spread, votes, floats, shares) in some.items():
        row, column = divmod(place, SIZE[1])
        around = [
            some[one * SIZE[1] + other][2]
            for one in range(max(row - 1, 0), min(row + 2, SIZE[0]))
            for other in range(max(column - 1, 0), min(column + 2, SIZE[1]))
            if one * SIZE[1] + other in some
        ]
        moves, costs = [], []
        for step in range(STEPS):
            fits, clashes = (sum(one[step][which] for one in around) for which in (0, 1))
            moves.append((2 * step / (STEPS - 1) - 1 - mean / (REACH * (spread + SPREAD))) ** 2)
            costs.append((clashes / (fits + clashes) if fits + clashes else 0.0) + STAY * moves[-1])
        best = costs.index(min(costs))
        if floats or votes[best][1] > votes[best][0]:
            continue
        elsewhere = REACH * (2 * best / (STEPS - 1) - 1) * (spread + SPREAD)
        found[place] = math.exp(mean if moves[best] == min(moves) else elsewhere), shares
    return found


def test_keyframes_added_one_by_one_are_all_windows_merged_at_once():
    """Seven keyframes of a wall with steps, noise and one thing in front, from places that see more or less sharply."""
    draw = torch.Generator().manual_seed(5)
    cameras = cameras_at(0.0, 0.4, -0.3, 0.2, 0.9, 0.1, -0.1)
    poses = cameras.world_from_camera.clone()
    poses[:, 2, 3] = torch.tensor([0.0, 0.0, 1.9, 0.3, 0.0, 2.1, 0.0])
    cameras = Cameras(poses, cameras.intrinsics, SIZE)
    depths = WALL - poses[:, 2, 3][:, None, None] + 0.08 * torch.randn(7, *SIZE, generator=draw)
    depths[3, 4:8, 5:11] = 1.5
    classes = torch.rand(7 * SIZE[0] * SIZE[1], 3, generator=draw)
    spread = 0.005 + 0.03 * torch.rand(7, *SIZE, generator=draw)
    encoding = encoded(cameras, depths, spread, classes / classes.sum(-1, keepdim=True))
    images = 0.5 + 0.2 * (torch.rand(7, 3, *SIZE, generator=draw) - 0.5)
    images[..., 9:] += 0.3
    parts = parts_of(encoding, seen_at(cameras, images), range(7))
    removed = 0
    for part, whole in zip(merged(parts), parts, strict=True):
        expected, found = by_loops(parts, whole), settle(part)
        assert sorted(found.index.tolist()) == sorted(expected)
        centre = part.sheet.camera.centres.float()
        before = (whole.gaussians.means[found.index] - centre).norm(dim=-1)
        ratios = (found.gaussians.means - centre).norm(dim=-1) / before
        rows = [expected[place] for place in found.index.tolist()]
        torch.testing.assert_close(ratios, torch.tensor([ratio for ratio, _ in rows]), rtol=2e-5, atol=0)
        torch.testing.assert_close(
            found.gaussians.semantic.features, torch.tensor([shares for _, shares in rows]), rtol=2e-4, atol=1e-5
        )
        removed += len(whole) - len(found)
    assert 0.15 < removed / (7 * SIZE[0] * SIZE[1]) < 0.8


def test_two_keyframes_that_are_equally_sure_meet_in_the_middle():
    """4 m and 4.1 m in the log: sqrt(4 * 4.1) = 4.0497 m, and Gaussians grow with their depth."""
    cameras = cameras_at(0.0, 0.0)
    parts = [settle(part) for part in merged(parts_of(encoded(cameras, flat(4.0, 4.1)), seen_at(cameras), (0, 1)))]
    for part, own in zip(parts, (4.0, 4.1), strict=True):
        torch.testing.assert_close(part.gaussians.means[:, 2], torch.full((len(part),), math.sqrt(4.0 * 4.1)))
        scales = torch.full((len(part), 3), 0.1 * math.sqrt(4.0 * 4.1) / own)
        torch.testing.assert_close(part.gaussians.colour.scales, scales)


def test_the_surer_keyframe_pulls_more():
    """Variances of 0.04^2 + 0.02^2 and 0.01^2 + 0.02^2: weights of 1 to 4, so the log moves by 4/5 of the way or by 1/5."""
    cameras = cameras_at(0.0, 0.0)
    spread = torch.stack((torch.full(SIZE, 0.04), torch.full(SIZE, 0.01)))
    unsure, sure = merged(parts_of(encoded(cameras, flat(4.0, 4.2), spread), seen_at(cameras), (0, 1)))
    expected = 4.0 * (4.2 / 4.0) ** 0.8
    torch.testing.assert_close(settle(unsure).gaussians.means[:, 2], torch.full((len(unsure),), expected))
    torch.testing.assert_close(settle(sure).gaussians.means[:, 2], torch.full((len(sure),), expected))


def test_what_another_keyframe_looks_through_is_a_floater_and_what_it_cannot_see_is_not():
    cameras = cameras_at(0.0, 0.0)
    front, back = merged(parts_of(encoded(cameras, flat(2.0, 4.0)), seen_at(cameras), (0, 1)))
    assert (len(settle(front)), len(settle(back))) == (0, SIZE[0] * SIZE[1])


def test_a_floater_that_as_many_keyframes_see_stays():
    cameras = cameras_at(0.0, 0.0, 0.0)
    parts = merged(parts_of(encoded(cameras, flat(2.0, 2.0, 4.0)), seen_at(cameras), (0, 1, 2)))
    assert [len(settle(part)) for part in parts] == [SIZE[0] * SIZE[1]] * 3


def test_gaussians_go_to_a_depth_that_photos_agree_with():
    """A line on a wall at 4 m that both keyframes believe to be at 4 e^0.5 = 6.6 m, to a factor e^0.5; the next depth that is tried is 4 e^0.25 = 5.1 m.

    The second camera is 1.5 m farther right and sees the line 16 * 1.5 / 4 = 6 pixels farther left, in column 4. At 6.6 m, the line of the first one would
    be in column 10.5 - 3.6 = 6.9, two pixels beside it. At 5.1 m it would be in column 5.8, next to it.
    """
    cameras, images = cameras_at(0.0, 1.5), torch.zeros(2, 3, *SIZE)
    images[0, ..., 10] = images[1, ..., 4] = 1
    depth = 4 * math.exp(0.5)
    encoding = encoded(cameras, flat(depth, depth), spread=0.48)
    found = settle(merged(parts_of(encoding, seen_at(cameras, images), (0, 1)))[0])
    column = found.index % SIZE[1]
    for place, expected in ((10, 4 * math.exp(0.25)), (14, depth)):
        z = found.gaussians.means[column == place, 2]
        torch.testing.assert_close(z, torch.full((SIZE[0],), expected))


def test_gaussians_that_no_photo_shows_are_dropped():
    """The first photo has a white line, the second one does not, and both keyframes are sure of the depth."""
    cameras, images = cameras_at(0.0, 0.0), torch.zeros(2, 3, *SIZE)
    images[0, ..., 10] = 1
    encoding = encoded(cameras, flat(4.0, 4.0))
    found = settle(merged(parts_of(encoding, seen_at(cameras, images), (0, 1)))[0])
    assert sorted({*range(SIZE[1])} - {*(found.index % SIZE[1]).tolist()}) == [10]


def test_a_photo_with_another_exposure_contradicts_nothing():
    cameras, images = cameras_at(0.0, 0.0), torch.full((2, 3, *SIZE), 0.8)
    images[1] -= 0.3
    parts = merged(parts_of(encoded(cameras, flat(4.0, 4.0)), seen_at(cameras, images), (0, 1)))
    assert [len(settle(part)) for part in parts] == [SIZE[0] * SIZE[1]] * 2
    assert exposure(parts[0].sheet, parts[1].sheet) == pytest.approx(0.3)


def test_the_first_four_of_six_equal_keyframes_stay_and_get_thinner():
    """Four layers: sizes times (2 / 4)^0.5. Semantic Gaussians keep theirs, because classes sum to 1 whatever the thickness."""
    cameras = cameras_at(*[0.0] * 6)
    parts = [settle(part) for part in merged(alone(encoded(cameras, flat(*[4.0] * 6)), cameras))]
    assert (LAYERS, SHRINK) == (4, 0.5)
    assert [len(part) > 0 for part in parts] == [True] * 4 + [False] * 2
    torch.testing.assert_close(parts[0].gaussians.colour.scales, torch.full((len(parts[0]), 3), 0.1 * 0.5**0.5))
    torch.testing.assert_close(parts[0].gaussians.semantic.scales, torch.full((len(parts[0]), 3), 0.1))


def test_keyframes_that_come_closer_replace_those_from_afar():
    """Four at 1 m after one at 4 m: the first one's Gaussians go where the others see the wall."""
    poses = cameras_at(*[0.0] * 5).world_from_camera.clone()
    poses[1:, 2, 3] = 3.0
    cameras = Cameras(poses, cameras_at(*[0.0] * 5).intrinsics, SIZE)
    far, *close = merged(alone(encoded(cameras, flat(4.0, *[1.0] * 4)), cameras))
    assert [len(one) for one in close] == [SIZE[0] * SIZE[1]] * 4
    gone = SIZE[0] * SIZE[1] - len(far)
    # The closer images cover a quarter of each side: 12 x 18 / 16 pixels.
    assert gone == pytest.approx(SIZE[0] * SIZE[1] / 16, abs=3)


def test_places_count_over_the_views_in_order():
    cameras = cameras_at(0.0, 0.3)
    parts = parts_of(encoded(cameras, flat(4.0, 4.0)), seen_at(cameras), (3, 8))
    some = [parts[0][parts[0].index % 2 == 0], parts[1][parts[1].index < 5]]
    gaussians, places = join_parts(some)
    blocks = SIZE[0] * SIZE[1]
    assert places.tolist() == [*range(0, blocks, 2), *range(blocks, blocks + 5)]
    torch.testing.assert_close(gaussians.means[-5:], parts[1].gaussians.means[:5])


def test_sizes_that_a_window_of_three_has_shrunk_are_undone():
    """The network gave Gaussians that three views see (2 / 3)^0.5 of their size; merging counts layers itself."""
    cameras = cameras_at(0.0, 0.0, 0.0)
    pair, three = (encoded(cameras[:views], flat(*[4.0] * views)) for views in (2, 3))
    sizes = [unshrunk(one, cameras[: len(one.depths)]).gaussians.colour.scales[:1] for one in (pair, three)]
    torch.testing.assert_close(sizes[1], sizes[0] * 1.5**0.5)


def test_hidden_pixels_have_no_gaussians_and_no_votes() -> None:
    """Both keyframes see the same wall from one place. Keyframe 1 hides its left 9 columns: the Gaussians of keyframe 0 there get no vote."""
    cameras, hidden = cameras_at(0.0, 0.0), torch.zeros(2, *SIZE, dtype=torch.bool)
    hidden[1, :, :9] = True
    parts = parts_of(encoded(cameras, flat(WALL, WALL)), seen_at(cameras).changed(hidden=hidden), (0, 1))
    assert [len(part) for part in parts] == [SIZE[0] * SIZE[1], SIZE[0] * SIZE[1] // 2]
    assert (parts[1].index % SIZE[1] >= 9).all()
    votes = votes_of(parts[0], parts[1].sheet)
    right = torch.arange(SIZE[0] * SIZE[1]) % SIZE[1] >= 9
    assert torch.equal(votes.agree > 0, right)
    assert torch.equal((votes.fits + votes.clashes).sum(1) > 0, right)
