"""Views: image and camera move together."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch
from landmarks import POINTS, drawn, found, looking

from semgs.data.resampling import cropped, default_size, kept_size, reframed, resized
from semgs.data.views import Views, joined, stack
from semgs.geometry.cameras import Cameras, project

SIZE = (180, 250)
K = np.array([[230.0, 0, 131.7], [0, 221.0, 83.2], [0, 0, 1]])
POSES = np.stack([looking((0.5, -0.3, -3.0), (0, 0, 0)), looking((-0.4, 0.2, -2.8), (0.1, 0, 0), -0.2)])


def projected(pose: np.ndarray, intrinsics: np.ndarray = K) -> np.ndarray:
    """Where the landmarks are seen, by hand."""
    inside = (POINTS - pose[:3, 3]) @ pose[:3, :3]
    homogeneous = inside @ intrinsics.T
    return homogeneous[:, :2] / homogeneous[:, 2:]


@pytest.fixture(scope="module")
def views() -> Views:
    """Two views of the landmarks with depths and labels that tell the pixel they are from."""
    images = [drawn(SIZE, projected(pose), sigma=3) for pose in POSES]
    rows, columns = torch.meshgrid(torch.arange(SIZE[0]), torch.arange(SIZE[1]), indexing="ij")
    return Views(
        images=torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).float() / 255,
        cameras=Cameras(POSES, np.stack([K, K]), SIZE),
        depth_range=[(1.0, 8.0), (1.5, 9.0)],
        labels=((rows // 9 + columns // 9) % 20).to(torch.uint8).expand(2, *SIZE).contiguous(),
        depths=(1 + rows + 1000 * columns).float().expand(2, *SIZE).contiguous(),
    )


def offsets(moved: Views) -> np.ndarray:
    """How far the landmarks in the pictures are from where the cameras put them [px]."""
    seen = project(torch.from_numpy(np.stack([POINTS, POINTS])), moved.cameras)[..., :2].numpy()
    reach = tuple(14 * float(new / old) for new, old in zip(moved.cameras.focal_px[0], np.diag(K), strict=False))
    return np.stack([found(image, where, reach) - where for image, where in zip(moved.images, seen, strict=True)])


@pytest.mark.parametrize("size", [(90, 125), (100, 210), (131, 160), (240, 320), (120, 400), (260, 160)])
def test_a_point_is_seen_on_its_feature_after_resizing_whatever_the_aspect(views, size):
    moved = resized(views, size)
    assert moved.size == moved.cameras.size == size == tuple(moved.images.shape[-2:])
    assert np.abs(offsets(moved)).max() < 0.08
    torch.testing.assert_close(moved.depth_range, views.depth_range)


def test_a_point_is_seen_on_its_feature_after_cropping(views):
    moved = cropped(views, 5, 9, (170, 236))
    assert moved.size == (170, 236)
    assert np.abs(offsets(moved)).max() < 0.05
    assert torch.equal(moved.images, views.images[..., 5:175, 9:245])
    assert torch.equal(moved.labels, views.labels[..., 5:175, 9:245])
    assert torch.equal(moved.depths, views.depths[..., 5:175, 9:245])


@pytest.mark.parametrize(
    ("top", "left", "size"), [(-1, 0, (10, 10)), (0, 0, (181, 10)), (175, 0, (6, 10)), (0, 245, (5, 6)), (0, 0, (0, 5))]
)
def test_windows_that_reach_outside_are_refused(views, top, left, size):
    with pytest.raises(ValueError, match="expected a part of images"):
        cropped(views, top, left, size)


def test_shrinking_by_a_whole_number_is_the_mean_of_blocks(views):
    moved = resized(views, (60, 50))
    blocks = views.images.unflatten(-2, (60, 3)).unflatten(-1, (50, 5)).mean(dim=(-3, -1))
    torch.testing.assert_close(moved.images, blocks)


@pytest.mark.parametrize("size", [(97, 131), (179, 249), (33, 250)])
def test_shrinking_by_any_ratio_weighs_pixels_by_the_area_they_share(views, size):
    moved = resized(views, size)
    for image, expected in zip(moved.images, views.images, strict=True):
        area = cv2.resize(expected.permute(1, 2, 0).numpy(), size[::-1], interpolation=cv2.INTER_AREA)
        np.testing.assert_allclose(image.permute(1, 2, 0).numpy(), area, atol=1e-5)


def test_enlarging_interpolates_between_pixel_centres(views):
    moved = resized(views, (301, 407))
    expected = torch.nn.functional.interpolate(views.images, (301, 407), mode="bilinear", align_corners=False)
    torch.testing.assert_close(moved.images, expected, atol=1e-5, rtol=0)


def test_resizing_keeps_the_mean_colour(views):
    torch.testing.assert_close(resized(views, (77, 103)).images.mean((-1, -2)), views.images.mean((-1, -2)))


@pytest.mark.parametrize("size", [(60, 50), (77, 103), (300, 410)])
def test_labels_and_depths_come_from_the_pixel_that_holds_their_centre(views, size):
    moved = resized(views, size)
    rows = [int((row + 0.5) * SIZE[0] / size[0]) for row in range(size[0])]
    columns = [int((column + 0.5) * SIZE[1] / size[1]) for column in range(size[1])]
    assert torch.equal(moved.labels, views.labels[:, rows][:, :, columns])
    assert torch.equal(moved.depths, views.depths[:, rows][:, :, columns])
    if size == (60, 50):  # what OpenCV takes instead is the pixel at the new pixel's corner
        assert not np.array_equal(
            cv2.resize(views.labels[0].numpy(), size[::-1], interpolation=cv2.INTER_NEAREST), moved.labels[0]
        )


def test_resizing_to_the_same_size_changes_nothing(views):
    assert resized(views, SIZE) is views


def test_a_batch_is_resized_and_cropped_as_its_scenes_are(views):
    batch = stack([views, views.select([1, 0])])
    for move in (lambda v: resized(v, (91, 133)), lambda v: cropped(v, 3, 5, (91, 133))):
        together, apart = move(batch), move(views)
        assert torch.equal(together.images[0], apart.images)
        assert torch.equal(together.images[1], apart.images[[1, 0]])
        assert torch.equal(together.cameras.intrinsics[0], apart.cameras.intrinsics)
        assert torch.equal(together.labels[1, 0], apart.labels[1])


def test_another_aspect_is_cropped_about_the_middle_and_never_stretched(views):
    moved = reframed(views, (90, 90))  # of 180x250 the middle 180x180 stay, from column 35 on, halved
    k, old = moved.cameras.intrinsics[0], views.cameras.intrinsics[0]
    torch.testing.assert_close(k[0], torch.stack((old[0, 0] / 2, old[0, 1] / 2, (old[0, 2] - 35) / 2)))
    torch.testing.assert_close(k[1], old[1] / 2)
    assert torch.equal(moved.images, resized(cropped(views, 0, 35, (180, 180)), (90, 90)).images)
    assert torch.equal(moved.depths, views.depths[:, 1::2, 36:216:2])
    upright = reframed(views, (144, 100))
    assert upright.size == (144, 100)
    assert (upright.cameras.focal_px / views.cameras.focal_px).allclose(torch.tensor(0.8, dtype=torch.float64))


@pytest.mark.parametrize(
    ("old", "size", "kept"),
    [
        ((360, 480), (272, 272), (360, 360)),
        ((480, 360), (272, 272), (360, 360)),
        ((968, 1296), (240, 320), (968, 1296)),  # 0.4 % apart: stretched
        ((1080, 1920), (240, 320), (1080, 1440)),
        ((3, 1000), (1000, 3), (3, 1)),
    ],
)
def test_what_is_kept_of_another_aspect(old, size, kept):
    assert kept_size(old, size) == kept


@pytest.mark.parametrize("size", [(0, 10), (10, -3), (10,), (-1, -2)])
def test_impossible_sizes_are_refused(views, size):
    with pytest.raises(ValueError, match="two positive integers"):
        resized(views, size)


@pytest.mark.parametrize(
    ("size", "expected"),
    [((360, 540), (224, 336)), ((1920, 1080), (368, 208)), ((480, 640), (240, 320)), ((240, 320), (240, 320))],
)
def test_the_default_size_keeps_the_aspect_in_multiples_of_sixteen(size, expected):
    assert default_size(size) == expected


def test_the_default_size_never_enlarges_and_never_exceeds_its_limit():
    for height, width in np.random.default_rng(0).integers(1, 5000, (3000, 2)).tolist():
        small = default_size((height, width))
        assert small[0] <= height
        assert small[1] <= width
        assert small[0] * small[1] <= 76_800
        assert all(side % 16 == 0 or side < 16 for side in small)
    assert default_size((11, 200)) == (11, 192)


def image(height: int = 8, width: int = 11, count: int = 2) -> torch.Tensor:
    return torch.full((count, 3, height, width), 0.5)


def cameras(height: int = 8, width: int = 11, count: int = 2) -> Cameras:
    return Cameras(np.stack([POSES[0]] * count), np.stack([K] * count), (height, width))


BOUNDS = [[0.5, 10.0], [0.5, 10.0]]
LABELS = torch.zeros(2, 8, 11, dtype=torch.uint8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cameras": cameras(8, 10)}, r"images are \(8, 11\) .* cameras are for \(8, 10\); crop or resize both"),
        ({"cameras": cameras(count=3)}, "expected one camera per image"),
        ({"images": image() + 0.6}, "expected finite numbers in 0..1"),
        ({"images": image() * float("nan")}, "expected finite numbers in 0..1"),
        ({"images": image()[:, :2]}, "expected"),
        ({"depth_range": [[1.0, 1.0]] * 2}, "0 < near < far"),
        ({"depth_range": [[0.0, 1.0]] * 2}, "0 < near < far"),
        ({"depth_range": [[5.0, 1.0]] * 2}, "0 < near < far"),
        ({"depth_range": [[1.0, float("inf")]] * 2}, "0 < near < far"),
        ({"depth_range": [[1.0, 2.0]]}, "near and far of each view"),
        ({"labels": LABELS + 20}, "labels contain 20; expected 0..19"),
        ({"labels": LABELS[:1]}, "like the images"),
        ({"depths": -torch.ones(2, 8, 11)}, "negative or not finite"),
        ({"depths": torch.ones(2, 8, 11) * float("nan")}, "negative or not finite"),
        ({"depths": torch.ones(2, 11, 8)}, "like the images"),
    ],
)
def test_views_that_cannot_be_are_refused(change, message):
    good = {"images": image(), "cameras": cameras(), "depth_range": BOUNDS, "labels": LABELS}
    Views(**good)
    with pytest.raises(ValueError, match=message):
        Views(**{**good, **change})


def test_pixels_without_a_label_are_allowed():
    assert (Views(image(), cameras(), BOUNDS, labels=LABELS + 255).labels == 255).all()


def test_views_are_made_from_plain_arrays():
    pictures = np.random.default_rng(0).integers(0, 256, (2, *SIZE, 3), dtype=np.uint8)
    views = Views.from_arrays(pictures, POSES, K, (1, 5))
    assert views.images.shape == (2, 3, *SIZE)
    torch.testing.assert_close(views.images[1, :, 7, 9], torch.from_numpy(pictures[1, 7, 9] / np.float32(255)))
    same = Views.from_arrays(list(views.images), POSES, [K, K], [(1, 5), (1, 5)])
    assert torch.equal(same.images, views.images)
    with pytest.raises(ValueError, match="expected uint8"):
        Views.from_arrays(pictures.astype(np.int32), POSES, K, (1, 5))


def test_a_depth_range_that_is_not_given_is_that_of_rooms_and_said():
    pictures = np.zeros((2, *SIZE, 3), dtype=np.uint8)
    with pytest.warns(UserWarning, match=r"taken as 0\.5 to 10 metres"):
        views = Views.from_arrays(pictures, POSES, K)
    assert views.depth_range.tolist() == [[0.5, 10.0]] * 2


def counted(monkeypatch: pytest.MonkeyPatch, kind: type) -> list[int]:
    """Counts how often a kind of object is checked from here on: once for each that its constructor makes."""
    checks, constructor = [0], kind.__init__

    def counting(self, *arguments, **named):
        checks[0] += 1
        constructor(self, *arguments, **named)

    monkeypatch.setattr(kind, "__init__", counting)
    return checks


def test_views_that_follow_from_views_are_not_checked_again_and_would_pass(views, monkeypatch):
    of_views, of_cameras = counted(monkeypatch, Views), counted(monkeypatch, Cameras)
    batch = stack([views, views.select([1, 0])])
    derived = [
        views.select([1]), batch, batch.select([0]), joined([batch, batch]), resized(batch, (91, 133)),
        cropped(views, 3, 5, (91, 133)), views.to("cpu"), views.changed(labels=None), views.map(lambda maps: maps.flip(-2)),
        views.arranged(lambda array: array[None]),
    ]  # fmt: skip
    assert (of_views, of_cameras) == ([0], [0])
    for one in derived:
        checked = one.checked()
        assert torch.equal(checked.images, one.images)
        again = Cameras(one.cameras.world_from_camera, one.cameras.intrinsics, one.size)
        assert torch.equal(again.world_from_camera, one.cameras.world_from_camera)
    assert (of_views, of_cameras) == ([len(derived)], [len(derived)])


def test_checking_finds_what_was_trusted_wrongly(views):
    with pytest.raises(ValueError, match=r"expected finite numbers in 0\.\.1"):
        views.map(lambda maps: maps + 1).checked()


def test_views_one_after_the_other_keep_labels_only_where_all_have_them(views):
    both = joined([views, views.select([1]).changed(depths=None)])
    assert torch.equal(both.images, views.images[[0, 1, 1]])
    assert torch.equal(both.labels, views.labels[[0, 1, 1]])
    assert both.depths is None
    assert both.depth_range.tolist() == [[1.0, 8.0], [1.5, 9.0], [1.5, 9.0]]
    assert torch.equal(both.cameras.intrinsics, views.cameras.intrinsics[[0, 1, 1]])


def test_a_pixel_is_hidden_if_a_hidden_one_takes_part_in_its_colour():
    """8 columns become 4, 6 and 16: column 2 is half of the second pair; of six, each covers 4/3 columns, so 1 and 2 share it; in 16, linear interpolation reaches from -1/4 to 3/4."""
    cameras = Cameras(POSES[:1], K[None], (2, 8))
    hidden = torch.zeros(1, 2, 8, dtype=torch.bool)
    hidden[..., 2] = True
    views = Views(torch.rand(1, 3, 2, 8), cameras, [(1.0, 8.0)], hidden=hidden)
    for columns, expected in ((4, [1]), (6, [1, 2]), (16, [3, 4, 5, 6])):
        found = resized(views, (2, columns)).hidden
        assert found.dtype == torch.bool
        assert found[0, 0].nonzero()[:, 0].tolist() == expected
    assert cropped(views, 0, 1, (2, 4)).hidden[0, 0].tolist() == [False, True, False, False]


def test_views_without_hidden_pixels_join_those_with_some(views):
    hidden = torch.zeros(2, *SIZE, dtype=torch.bool)
    hidden[1, 5, 7] = True
    masked = Views(views.images, views.cameras, views.depth_range, hidden=hidden)
    assert joined([views, masked]).hidden.nonzero().tolist() == [[3, 5, 7]]
    assert stack([masked, views]).hidden.nonzero().tolist() == [[0, 1, 5, 7]]
    assert joined([views, views]).hidden is None
    assert masked.select([1]).hidden.sum() == 1


@pytest.mark.parametrize(
    ("hidden", "message"),
    [(torch.zeros(2, 5, 5, dtype=torch.bool), "hidden are"), (torch.zeros(2, *SIZE), "torch.bool")],
)
def test_hidden_pixels_are_booleans_of_the_images_size(views, hidden, message):
    with pytest.raises(ValueError, match=message):
        Views(views.images, views.cameras, views.depth_range, hidden=hidden)
