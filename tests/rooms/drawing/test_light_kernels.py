import numpy as np

from semgs_rooms.drawing import light_kernels as kernels


def test_the_pixels_of_a_square_all_use_different_numbers():
    width = 9
    drawn = {
        kernels.stratum(row * width + column, width, tap, 4)
        for row in range(4)
        for column in range(4)
        for tap in range(4)
    }
    assert len(drawn) == 64
    points = np.array(sorted(drawn))
    assert np.histogram2d(points[:, 0], points[:, 1], bins=4, range=[[0, 1], [0, 1]])[0].min() >= 2


def surface(height, width):
    """A floor on the left half, a wall that rises from it on the right half."""
    rows, columns = np.meshgrid(np.arange(height), np.arange(width), indexing="ij")
    wall = columns >= width // 2
    places = np.stack(
        (np.minimum(columns, width // 2) * 0.1, rows * 0.1, np.where(wall, (columns - width // 2) * 0.1, 0.0)), -1
    )
    normals = np.where(wall[..., None], (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return wall, places.reshape(-1, 3).astype(float), normals.reshape(-1, 3)


def test_smoothing_takes_the_mean_of_a_square_and_stops_at_an_edge():
    height, width = 8, 12
    wall, places, normals = surface(height, width)
    rng = np.random.default_rng(0)
    values = rng.uniform(0, 1, (height * width, 2)) + 10 * wall.reshape(-1, 1)
    out = np.empty_like(values)
    kernels.smooth(
        values, np.zeros(height * width, np.int64), normals, places, np.full(height * width, 2.0), width, out
    )
    assert (out[wall.ravel()] > 9.9).all()
    assert (out[~wall.ravel()] < 1.1).all()
    grid = values.reshape(height, width, 2)
    np.testing.assert_allclose(out.reshape(height, width, 2)[4, 2], grid[3:7, 1:5].mean(axis=(0, 1)))
    np.testing.assert_allclose(out.reshape(height, width, 2)[4, 5], grid[3:7, 4:6].mean(axis=(0, 1)))


def test_near_rays_leave_the_surface_about_its_normal():
    width, rng = 7, np.random.default_rng(1)
    planes = rng.normal(size=(3, 4))
    planes[:, :3] /= np.linalg.norm(planes[:, :3], axis=-1, keepdims=True)
    triangles = rng.integers(0, 3, 28)
    directions, places = rng.normal(size=(28, 3)), rng.normal(size=(28, 3))
    origins, ways = np.empty((28, 3)), np.empty((28, 3))
    mean = np.zeros((28, 3))
    for tap in range(kernels.TAPS):
        kernels.near_rays(triangles, directions, places, planes, width, tap, origins, ways)
        facing = planes[triangles, :3] * -np.sign((planes[triangles, :3] * directions).sum(-1, keepdims=True))
        np.testing.assert_allclose(np.linalg.norm(ways, axis=-1), kernels.REACH, rtol=1e-9)
        assert ((ways * facing).sum(-1) >= -1e-9).all()
        np.testing.assert_allclose(origins - places, 0.003 * facing, atol=1e-12)
        mean += ways / kernels.TAPS
    assert (mean * facing).sum() / 28 / kernels.REACH > 0.5


def test_what_meets_nothing_brings_the_rooms_light_and_what_touches_brings_the_parts():
    ambient, glow = np.array([0.5, 0.6, 0.7]), np.array([[0.1, 0.0, 0.2], [3.0, 2.0, 1.0]])
    out = np.zeros((3, 3))
    for _ in range(kernels.TAPS):
        kernels.bring_back(np.array([-1, 0, 0]), np.array([np.inf, 0.0, 1.0]), np.array([1]), glow, ambient, out)
    np.testing.assert_allclose(out, [ambient, glow[1], ambient])


def test_a_ray_beside_a_pixel_borrows_from_the_neighbour_that_shows_its_part():
    owners = np.array([0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 1, 1])
    values = np.arange(12.0)[:, None]
    out = np.empty((3, 1))
    kernels.borrow(np.array([5, 5, 5]), np.array([0, 1, 2]), owners, 4, values, out)
    np.testing.assert_array_equal(out[:, 0], [5, 6, 5])
