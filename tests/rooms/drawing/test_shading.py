import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs_rooms.drawing.room import build_room
from semgs_rooms.drawing.shading import RoomCamera, centres, look, photograph, pixel_directions
from semgs_rooms.pieces import materials, texture_kernels
from semgs_rooms.sets.room_stream import generator

CAMERA = RoomCamera(np.array([[41.0, 0, 30.5], [0, 46.0, 25.2], [0, 0, 1]]), (48, 60))


def corner_view(room) -> np.ndarray:
    """From under the ceiling, near a corner, across the room."""
    x, y, z = room.plan.size
    forward = np.array([x, y, -1.2 * z])
    forward /= np.linalg.norm(forward)
    right = np.array([forward[1], -forward[0], 0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(forward, right), forward
    pose[:3, 3] = -x / 2 + 0.1, -y / 2 + 0.1, z - 0.1
    return pose


def test_depths_are_z_depths_of_pixel_centres():
    """The ray-caster's own distance, in float32, along rays through pixel centres."""
    room = build_room(generator(0, 1))
    pose = corner_view(room)
    frame = photograph(room, pose, CAMERA)
    directions = pixel_directions(pose, CAMERA.intrinsics, centres((48, 60)))
    np.testing.assert_allclose(directions @ pose[:3, 2], 1, atol=1e-12)
    triangles, distances = room.caster.cast(np.broadcast_to(pose[:3, 3], directions.shape), directions)
    np.testing.assert_allclose(frame.depths.ravel(), distances, rtol=2e-4)
    assert (frame.labels.ravel() == room.solids.labels[room.owners[triangles]]).all()


def test_looking_without_colours_sees_the_same_labels_and_depths():
    room = build_room(generator(0, 2))
    pose = corner_view(room)
    frame = photograph(room, pose, CAMERA)
    labels, depths = look(room, pose, pixel_directions(pose, CAMERA.intrinsics, centres((48, 60))))
    assert (labels == frame.labels.ravel()).all()
    np.testing.assert_allclose(depths, frame.depths.ravel(), rtol=1e-6)


def test_radiance_is_finite_and_nowhere_negative():
    for index in range(8):
        room = build_room(generator(0, index))
        frame = photograph(room, corner_view(room), CAMERA)
        assert np.isfinite(frame.radiance).all()
        assert frame.radiance.min() >= 0
        assert frame.radiance.std() > 0.005


def colours(material: np.ndarray, places: np.ndarray, foot: float) -> np.ndarray:
    result = np.empty((len(places), 3))
    for place, out in zip(places, result, strict=True):
        texture_kernels.texture(material, *place, place[0], place[1], foot, 0.37, out)
    return result


@pytest.mark.parametrize("kind", ["wall_paint", "wood", "fabric", "stone", "tiles", "books", "artwork", "rug"])
def test_a_pattern_fades_into_its_mean_where_pixels_are_wide(kind):
    """Neighbouring pixels 20 m wide see the same colour, and it is the pattern's mean."""
    rng = np.random.default_rng(3)
    for _ in range(4):
        material = getattr(materials, kind)(rng)
        places = rng.uniform(-1.5, 1.5, (300, 3))
        wide, fine = colours(material, places, 20.0), colours(material, places, 1e-4)
        assert wide.std(axis=0).max() < 0.06
        assert np.abs(wide.mean(axis=0) - fine.mean(axis=0)).max() < 0.15
        assert fine.min() > 0
        assert fine.max() < 1


def test_filtered_bands_are_the_mean_of_the_sharp_ones():
    positions = np.linspace(0.3, 0.3 + 0.8, 100_001)
    sharp = (positions % 1 < 0.35).mean()
    assert texture_kernels.filtered_band(0.7, 0.35, 0.8) == pytest.approx(sharp, abs=1e-4)


def test_noise_is_smooth_bounded_and_differs_by_seed():
    rng = np.random.default_rng(0)
    values, others = [], []
    for x, y, z in rng.uniform(-40, 40, (500, 3)):
        here = texture_kernels.value_noise(x, y, z, 5)
        assert abs(texture_kernels.value_noise(x + 1e-6, y, z, 5) - here) < 1e-4
        values.append(here)
        others.append(texture_kernels.value_noise(x, y, z, 6))
    assert np.abs(values).max() <= 1
    assert abs(np.corrcoef(values, others)[0, 1]) < 0.15
    assert abs(np.mean(values)) < 0.1
