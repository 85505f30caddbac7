"""How well two photos show the motion between their cameras."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from semgs.sfm.reasons import LEAST_NOISE_PX, direction_error_deg, parallax_px

FOCAL = 200.0


def sideways(depths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points that a camera sees before and after it moved 0.2 to the right [2 n 2], from the middle [px], and the motion."""
    places = np.random.default_rng(3).uniform(-100, 100, (len(depths), 2))
    motion = np.eye(4)
    motion[0, 3] = -0.2
    return np.stack((places, places - [0.2 * FOCAL, 0] / depths[:, None])), motion


def test_the_error_of_the_direction_is_that_of_the_linear_equations_of_a_sideways_motion():
    # With t = (-1, a, b), a turn w and the disparity d, x2 (t x (x1 + w x x1)) is (x1 x2) w_x - x (x2 w) - a d + b y d; [t]x x1 is (0, 1, -y), and so
    # both lines have length 1.
    matches, motion = sideways(np.linspace(2, 6, 40))
    first, second = (np.column_stack((one / FOCAL, np.ones(40))) for one in matches)
    d, turn = (first - second)[:, 0], -first[:, :1] * second
    turn[:, 0] += (first * second).sum(1)
    slopes = FOCAL / np.sqrt(2) * np.column_stack((turn, -d, first[:, 1] * d))
    variance = LEAST_NOISE_PX**2 * np.linalg.inv(slopes.T @ slopes)[3:, 3:]
    expected = np.degrees(np.sqrt(np.linalg.eigvalsh(variance)[-1]))
    assert direction_error_deg(matches, FOCAL, motion) == pytest.approx(expected, rel=1e-4)


def test_four_times_the_matches_halve_the_error():
    matches, motion = sideways(np.linspace(2, 6, 40))
    once, often = (direction_error_deg(np.tile(matches, (1, times, 1)), FOCAL, motion) for times in (1, 4))
    assert often == pytest.approx(once / 2, rel=1e-6)


def test_matches_that_show_no_direction_have_no_finite_error():
    matches, motion = sideways(np.full(40, 1e12))  # nothing moves
    assert direction_error_deg(matches, FOCAL, motion) == np.inf
    assert direction_error_deg(matches[:, :5], FOCAL, motion) == np.inf  # five matches fit any noise


def test_a_turn_leaves_no_parallax_whatever_the_focal_length():
    places = np.random.default_rng(3).uniform(-100, 100, (40, 2))
    rays = np.column_stack((places / 310, np.ones(40))) @ Rotation.from_rotvec([0.05, 0.12, 0.02]).as_matrix().T
    assert parallax_px(np.stack((places, 310 * rays[:, :2] / rays[:, 2:])), FOCAL) < 0.01


def test_a_motion_leaves_what_differs_from_the_middle_depth():
    # Points move by 20, 15 and 10 px; a turn makes up for 15, and two thirds of them are 5 px off.
    matches, _ = sideways(np.repeat([2.0, 8 / 3, 4.0], 40))
    assert parallax_px(matches, FOCAL) == pytest.approx(5, abs=0.7)
