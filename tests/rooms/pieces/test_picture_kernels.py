import numpy as np
import pytest

from semgs.files.images.colours import LINEAR
from semgs_rooms.assets.asset_images import pack, pyramid
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.picture_kernels import PANORAMA, STRETCHED, TILED, VIEW, lookup, picture

SIZE = (11, 18)  # height, width


@pytest.fixture(scope="module")
def packed():
    rng = np.random.default_rng(0)
    others = [rng.integers(0, 256, (h, w, 3), dtype=np.uint8) for h, w in ((4, 4), SIZE)]
    return pack([pyramid(other) for other in others])


def slow_lookup(packed, number, u, v, wide, repeat):
    """Trilinear look-up as the definition has it: explicit pixel centres, one level after the other."""
    start, width, height, count = packed.table[number]
    level = np.clip(np.log2(wide * width) - 0.5, 0, count - 1)
    result = np.zeros(3)
    for k in range(count):
        image = LINEAR[packed.pixels[start : start + width * height]].reshape(height, width, 3)
        weight = max(0.0, 1 - abs(level - k))
        if weight:
            value = np.zeros(3)
            for row in range(-2, height + 2):
                for column in range(-2, width + 2):
                    x, y = u % 1 if repeat else np.clip(u, 0, 1), v % 1 if repeat else np.clip(v, 0, 1)
                    near = max(0, 1 - abs(x * width - column - 0.5)) * max(0, 1 - abs(y * height - row - 0.5))
                    if repeat:
                        value += near * image[row % height, column % width]
                    else:
                        value += near * image[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)]
            result += weight * value
        start += width * height
        width, height = max(1, width // 2), max(1, height // 2)
    return result


@pytest.mark.parametrize("repeat", [True, False])
def test_look_ups_are_those_of_the_slow_definition(packed, repeat):
    rng = np.random.default_rng(2)
    out = np.empty(3)
    for _ in range(60):
        u, v = rng.uniform(-1.5, 2.5, 2)
        wide = float(np.exp(rng.uniform(np.log(0.01), np.log(2.0))))
        lookup(packed.pixels, packed.table[1], u, v, wide, repeat, out)
        np.testing.assert_allclose(out, slow_lookup(packed, 1, u, v, wide, repeat), atol=1e-9)


def material(mapping, scale=1.0, aspect=1.0, axis=-1):
    row = np.zeros(t.WIDTH)
    row[t.KIND], row[t.PICTURE_NUMBER], row[t.MAPPING] = t.PICTURE, 1, mapping
    row[t.SCALE], row[t.ASPECT], row[t.AXIS] = scale, aspect, axis
    row[t.COLOUR_A : t.COLOUR_A + 3] = 1.0
    return row


def shown(packed, row, local, facing, size=(2.0, 0.02, 1.0), direction=(0.0, 1.0, 0.0)):
    out = np.empty(3)
    arrays = (np.array(x, dtype=np.float64) for x in (local, facing, size, direction, (0.0, 0.0, 0.0)))
    local, facing, size, direction, uv = arrays
    picture(packed.pixels, packed.table, row, local, facing, size, direction, uv, 1e-4, 0.0, out)
    return out


def test_a_stretched_picture_hangs_upright_with_its_corners_in_the_faces_corners(packed):
    start, width, height, _ = packed.table[1]
    image = LINEAR[packed.pixels[start : start + width * height]].reshape(height, width, 3)
    row = material(STRETCHED)
    for column, x in ((0, -1 + 1 / width), (width - 1, 1 - 1 / width)):
        for line, z in ((0, 0.5 - 0.5 / height), (height - 1, -0.5 + 0.5 / height)):
            np.testing.assert_allclose(
                shown(packed, row, (x, 0.01, z), (0, 1, 0)), np.clip(image[line, column], 0.002, 0.98), atol=1e-9
            )


def test_tiles_repeat_after_their_width_and_height(packed):
    row = material(TILED, scale=0.6, aspect=0.5)
    here = shown(packed, row, (0.1, 0.0, 0.2), (0, 1, 0))
    np.testing.assert_allclose(shown(packed, row, (0.7, 0.0, 0.2), (0, 1, 0)), here, atol=1e-9)
    np.testing.assert_allclose(shown(packed, row, (0.1, 0.0, -0.1), (0, 1, 0)), here, atol=1e-9)
    assert np.abs(shown(packed, row, (0.4, 0.0, 0.2), (0, 1, 0)) - here).max() > 1e-3


def test_rows_run_along_the_grains_axis_where_it_lies_in_the_face(packed):
    lying, upright = material(TILED, axis=0), material(TILED, axis=2)
    along_x = shown(packed, lying, (0.2, 0.0, -0.3), (0, 1, 0))
    np.testing.assert_allclose(shown(packed, upright, (-0.3, 0.0, 0.2), (0, 1, 0)), along_x, atol=1e-9)


@pytest.mark.parametrize("mapping", [PANORAMA, VIEW])
def test_a_view_depends_on_the_direction_alone(packed, mapping):
    row = material(mapping, scale=2 * np.pi if mapping == PANORAMA else 1.2, aspect=0.5)
    here = shown(packed, row, (0.1, 0.0, 0.2), (0, 1, 0), direction=(0.3, 0.9, 0.1))
    np.testing.assert_allclose(
        shown(packed, row, (-0.8, 0.0, 0.4), (1, 0, 0), direction=(0.6, 1.8, 0.2)), here, atol=1e-12
    )
    assert np.abs(shown(packed, row, (0.1, 0.0, 0.2), (0, 1, 0), direction=(-0.9, 0.3, 0.1)) - here).max() > 1e-3


def test_straight_up_a_panorama_shows_its_first_row_and_straight_down_its_last(packed):
    start, width, height, _ = packed.table[1]
    image = LINEAR[packed.pixels[start : start + width * height]].reshape(height, width, 3)
    row = material(PANORAMA, scale=2 * np.pi, aspect=0.5)
    for up, line in ((1.0, 0), (-1.0, height - 1)):
        colour = shown(packed, row, (0, 0, 0), (0, 1, 0), direction=(0.0, 0.0, up))
        middle = np.clip((image[line, 0] + image[line, -1]) / 2, 0.002, 0.98)
        np.testing.assert_allclose(
            colour, middle, atol=1e-9
        )  # azimuth 0 is the seam between the last and the first column
