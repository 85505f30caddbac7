"""Black borders are found in photos, and dark rooms have none."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from semgs.data.borders import STEP, find_border

SIZE = (120, 170)


def photo(brightness: float = 150.0, noise: float = 6.0, seed: int = 0) -> np.ndarray:
    """A textured photo; its darkest pixels are a third as bright as its brightest ones."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    texture = 0.75 + 0.25 * np.sin(rows / 7 + 1)[..., None] * np.cos(columns / 9)[..., None]
    image = brightness * texture * np.array([1.0, 0.8, 0.6]) + rng.normal(0, noise, (*SIZE, 3))
    return image.clip(0, 255).round().astype(np.uint8)


def compressed(image: np.ndarray, quality: int) -> np.ndarray:
    """The image after JPEG."""
    _, data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))


def framed(
    image: np.ndarray, top: int, right: int, bottom: int, left: int, level: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """The image with a border of these widths, and which pixels belong to it."""
    border = np.ones(SIZE, np.bool_)
    border[top : SIZE[0] - bottom, left : SIZE[1] - right] = False
    return np.where(border[..., None], np.uint8(level), image), border


@pytest.mark.parametrize(("quality", "level"), [(None, 0), (None, 6), (95, 0), (95, 6), (75, 0)])
def test_a_frame_of_three_pixels_is_hidden_with_the_step_behind_it_also_after_jpeg(
    quality: int | None, level: int
) -> None:
    image, border = framed(photo(), 3, 3, 3, 3, level)
    hidden = find_border(image if quality is None else compressed(image, quality))
    assert hidden is not None
    assert hidden[border].all()
    assert not hidden[3 + STEP + 2 : -(3 + STEP + 2), 3 + STEP + 2 : -(3 + STEP + 2)].any()
    if quality is None:
        assert (hidden == framed(photo(), *[3 + STEP] * 4)[1]).all()


def test_sides_have_widths_of_their_own_and_a_side_without_border_stays() -> None:
    hidden = find_border(framed(photo(), 2, 0, 5, 4)[0])
    assert hidden is not None
    assert (hidden == framed(photo(), 2 + STEP, 0, 5 + STEP, 4 + STEP)[1]).all()


def test_one_black_side_is_enough_if_it_is_whole() -> None:
    hidden = find_border(framed(photo(), 0, 0, 0, 4)[0])
    assert hidden is not None
    assert (hidden == framed(photo(), 0, 0, 0, 4 + STEP)[1]).all()
    image = photo()
    image[:70, :4] = 0  # 58 % of the side
    assert find_border(image) is None


def test_a_curved_border_is_followed_within_a_pixel() -> None:
    """The left and right edges are parabolas: 6 px at the ends, 2 px in the middle."""
    image, rows = photo(), np.arange(SIZE[0])
    width = np.round(2 + 4 * ((rows - 59.5) / 59.5) ** 2).astype(int)
    inside = (np.arange(SIZE[1]) >= width[:, None]) & (np.arange(SIZE[1]) < SIZE[1] - width[:, None])
    hidden = find_border(np.where(inside[..., None], image, np.uint8(0)))
    assert hidden is not None
    for side in (hidden, hidden[:, ::-1]):
        assert (abs(side.sum(1) / 2 - width - STEP) <= 1)[8:-8].all()


@pytest.mark.parametrize("quality", [None, 75])
@pytest.mark.parametrize("turned", [False, True])
def test_the_bars_of_a_film_are_hidden_however_wide(turned: bool, quality: int | None) -> None:
    """A film of 16:9 in an image of 4:3 leaves 1/8 of the height above and below, more than the 1/16 of a border."""
    image = framed(photo(), 0, 26, 0, 25)[0] if turned else framed(photo(), 15, 0, 16, 0)[0]
    border = framed(photo(), *((0, 26 + STEP, 0, 25 + STEP) if turned else (15 + STEP, 0, 16 + STEP, 0)))[1]
    hidden = find_border(image if quality is None else compressed(image, quality))
    assert hidden is not None
    assert (hidden == border).mean() == 1 if quality is None else (hidden == border).mean() > 0.97


def test_black_above_and_below_are_no_bars_if_they_differ_or_fade() -> None:
    assert find_border(framed(photo(), 15, 0, 22, 0)[0]) is None
    assert find_border(framed(photo(), 50, 0, 50, 0)[0]) is None
    rows = np.minimum(np.arange(SIZE[0]), SIZE[0] - 1 - np.arange(SIZE[0]))
    fading = (4.0 * (rows - 12)).clip(0, 200)[:, None, None] / 200
    assert find_border((photo() * fading).round().astype(np.uint8)) is None


@pytest.mark.parametrize(("brightness", "noise"), [(12.0, 4.0), (25.0, 4.0), (40.0, 8.0), (3.0, 0.0), (0.0, 0.0)])
def test_a_dark_photo_has_no_border(brightness: float, noise: float) -> None:
    assert find_border(photo(brightness, noise)) is None


def test_a_photo_that_fades_to_black_has_no_border() -> None:
    """Each pixel from the edge is 4 brighter, so nothing is lit within three pixels of the last black one, at 20: 24, 28, 32."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    edge = np.minimum(np.minimum(rows, SIZE[0] - 1 - rows), np.minimum(columns, SIZE[1] - 1 - columns))
    image = np.repeat((4 * edge).clip(0, 200)[..., None], 3, -1).astype(np.uint8)
    assert find_border(image) is None
    image[edge == 6] = 40
    assert find_border(image) is not None


def test_black_regions_of_a_dark_room_are_no_border_even_at_the_edge() -> None:
    """A lamp lights the middle; the light fades to true black before the edge, and a black sofa reaches it."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    light = np.exp(-(((rows - 50) / 16) ** 2 + ((columns - 80) / 26) ** 2))[..., None]
    image = (photo(255.0) * light).astype(np.uint8)
    image[90:, 20:120] = 0
    assert (image[:, 0] == 0).mean() > 0.9
    assert find_border(image) is None


def test_a_black_thing_at_the_edge_is_no_border_and_does_not_widen_one() -> None:
    image = photo()
    image[40:52, :30] = 0
    image[100:, 60:90] = 0
    assert find_border(image) is None
    hidden = find_border(framed(image, 3, 3, 3, 3)[0])
    assert hidden is not None
    assert (hidden == framed(image, *[3 + STEP] * 4)[1]).all()


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (16, 5), (5, 40)])
def test_images_of_a_few_pixels_have_none(size: tuple[int, int]) -> None:
    assert find_border(np.zeros((*size, 3), np.uint8)) is None
