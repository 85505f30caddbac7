"""Errors planted in `semgs/robotics`."""

from __future__ import annotations

from planted.mutant import Mutant

ROBOTICS = (
    Mutant(
        "a box keeps the longer of its plan's sides as its width", "semgs/robotics/boxes.py",
        "(plan.length, plan.width, float(high - low))", "(plan.width, plan.length, float(high - low))",
        ("tests/robotics/test_boxes.py::test_a_turned_box_has_its_sides_and_its_yaw",),
    ),
    Mutant(
        "a box is turned the other way", "semgs/robotics/boxes.py",
        "np.arctan2(turn[0, 1], turn[0, 0])", "np.arctan2(turn[1, 0], turn[0, 0])",
        ("tests/robotics/test_boxes.py::test_a_turned_box_has_its_sides_and_its_yaw",),
    ),
    Mutant(
        "rays free the voxels behind the side that they enter", "semgs/robotics/occupancy.py",
        "(cells + (steps > 0) - origins) / along", "(cells + (steps < 0) - origins) / along",
        ("tests/robotics/test_occupancy.py::test_random_rays_visit_what_the_slow_twin_says",),
    ),
    Mutant(
        "rays do not stop at their end", "semgs/robotics/occupancy.py",
        ".min(1).clip(max=1)", ".min(1)",
        ("tests/robotics/test_occupancy.py::test_random_rays_visit_what_the_slow_twin_says",),
    ),
    Mutant(
        "rays free what they end in and beyond", "semgs/robotics/occupancy.py",
        "rays.origins + along * (free / lengths.clip(min=1e-9))[:, None]", "rays.origins + along * 1.2",
        ("tests/robotics/test_occupancy.py::test_what_no_ray_reached_is_never_free",),
    ),
    Mutant(
        "unseen cells are free", "semgs/robotics/occupancy.py",
        "[blocked, clear], [OCCUPIED, FREE], UNKNOWN", "[blocked, clear], [OCCUPIED, FREE], FREE",
        ("tests/robotics/test_occupancy.py::test_what_no_ray_reached_is_never_free",),
    ),
    Mutant(
        "uncertain depth frees as much as certain depth", "semgs/robotics/occupancy.py",
        "lengths * np.exp(-SPREADS * rays.spread)", "lengths",
        ("tests/robotics/test_occupancy.py::test_uncertain_depth_frees_less_and_gaussians_in_no_order_need_no_depths",),
    ),
    Mutant(
        "a table with the class of a floor is the floor", "semgs/robotics/floor.py",
        "if below > most:", "if below > 1:",
        ("tests/robotics/test_occupancy.py::test_the_floor_is_the_fullest_level_of_its_class_and_without_classes_the_lowest_full_one",),
    ),
    Mutant(
        "walls are things", "semgs/robotics/objects.py",
        'STUFF = ("wall", "floor", "ceiling")', 'STUFF = ("floor", "ceiling")',
        ("tests/robotics/test_objects.py::test_two_chairs_are_two_things_and_walls_are_none",),
    ),
    Mutant(
        "with classes the floor is the lowest level", "semgs/robotics/floor.py",
        "peak = int(np.argmax(full))", "peak = int(np.argmax(full >= LOWEST_PEAK * full.max()))", ("tests/robotics/test_floor.py::test_a_step_below_the_floor_is_not_the_floor",),
    ),
    Mutant(
        "things that are least alike continue one another", "semgs/robotics/tracking.py",
        "linear_sum_assignment(ious, maximize=True)", "linear_sum_assignment(ious)",
        ("tests/robotics/test_tracking.py::test_things_keep_their_numbers_whatever_order_they_are_found_in_and_new_ones_get_the_next",),
    ),
    Mutant(
        "the larger thing decides how much must be shared", "semgs/robotics/tracking.py",
        "np.minimum(mine, theirs)", "np.maximum(mine, theirs)",
        ("tests/robotics/test_tracking.py::test_a_quarter_of_the_smaller_thing_must_be_shared",),
    ),
    Mutant(
        "things that are not found are forgotten", "semgs/robotics/tracking.py",
        "np.concatenate((before[~np.isin(before[:, 0], numbers)], ", "np.concatenate((before[:0], ",
        ("tests/robotics/test_tracking.py::test_what_was_forgotten_and_is_mapped_anew_is_known_by_its_place",),
    ),
)  # fmt: skip
