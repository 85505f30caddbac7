"""Errors planted in `semgs/doctor`."""

from __future__ import annotations

from planted.mutant import Mutant

OF_DOCTOR = "tests/doctor/test_mistakes.py::"

DOCTOR = (
    Mutant(
        "inverted poses are undone without their axes", "semgs/doctor/mistakes.py",
        "yield _rewritten(given, inverse)", "yield replace(given.rig, poses=given.rig.poses)",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "axes are flipped in the world", "semgs/doctor/mistakes.py",
        "yield replace(given.rig, poses=given.rig.poses @ FLIP)", "yield replace(given.rig, poses=FLIP @ given.rig.poses)",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "pasted extrinsics keep their axes", "semgs/doctor/mistakes.py",
        "poses=given.convention.read(written) @ FLIP)", "poses=given.convention.read(written))",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "transposed rotations stay", "semgs/doctor/mistakes.py",
        "_with_rotation(matrices, matrices[:, :3, :3].mT)", "_with_rotation(matrices, matrices[:, :3, :3])",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "quaternions are tried in one other order only", "semgs/doctor/mistakes.py",
        "for order in ([3, 0, 1, 2], [1, 2, 3, 0]):", "for order in ([3, 0, 1, 2],):",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "a mirrored world keeps its positions", "semgs/doctor/mistakes.py",
        "poses[:, :3, 3] *= -1", "poses[:, :3, 3] *= 1",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "swapped focal lengths stay", "semgs/doctor/mistakes.py",
        "focal=given.rig.focal[:, ::-1])", "focal=given.rig.focal)",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "millimetres become decimetres", "semgs/doctor/mistakes.py",
        "for factor in (1e-3, 1e-2):", "for factor in (1e-1, 1e-2):",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "parallax has the wrong sign", "semgs/doctor/misses.py",
        "depths = -(across * step)", "depths = (across * step)",
        (f"{OF_DOCTOR}test_parallax_gives_the_depth_of_matches",),
    ),
    Mutant(
        "any distance of a room passes for metres", "semgs/doctor/diagnosis.py",
        "if np.isfinite(far) and not plausible(far):", "if False:",
        (f"{OF_DOCTOR}test_positions_that_put_a_room_far_away_are_not_in_metres",),
    ),
    Mutant(
        "the unit of depth is only made smaller", "semgs/doctor/mistakes.py",
        "(1e-3, 1e-2, 0.1, 10.0, 1e2, 1e3, 0.2, 5.0, 0.25, 4.0)", "(1e-3, 1e-2, 0.1, 0.2, 0.25)",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "images are off by one in one direction only", "semgs/doctor/mistakes.py",
        "for step in (1, -1):", "for step in (1,):",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "the order of text is undone in the wrong direction", "semgs/doctor/mistakes.py",
        "for order in (to_text, np.argsort(to_text)):", "for order in (to_text,):",
        (f"{OF_DOCTOR}test_images_sorted_as_text_are_named",),
    ),
    Mutant(
        "a focal length of another size is not searched", "semgs/doctor/mistakes.py",
        "        step **= 0.25\n", "        return given.rig\n",
        (f"{OF_DOCTOR}test_with_measured_depth_each_mistake_is_named_and_undone",),
    ),
    Mutant(
        "points behind a camera count", "semgs/doctor/misses.py",
        "(w >= 0) & (depth > 0)", "w == w",
        (f"{OF_DOCTOR}test_a_point_between_two_cameras_that_look_away_from_it_counts_as_nonsense",),
    ),
    Mutant(
        "measured depth is not used", "semgs/doctor/misses.py",
        "np.where(np.isfinite(depths), 1 / depths, nearest)", "nearest",
        (f"{OF_DOCTOR}test_the_miss_of_a_parallel_pair_is_the_distance_from_its_row",),
    ),
    Mutant(
        "a match may not be far away", "semgs/doctor/misses.py",
        "np.where(np.isfinite(depths), distances[0], np.minimum(*distances))", "distances[0]",
        (f"{OF_DOCTOR}test_the_miss_of_a_parallel_pair_is_the_distance_from_its_row",),
    ),
    Mutant(
        "warps ignore the unit of depth", "semgs/doctor/warps.py",
        "depths = rig.z_depths(first.points[:, 2], rays, i)", "depths = first.points[:, 2]",
        ("tests/doctor/test_warps.py::test_depth_twice_as_large_disagrees_by_how_the_cameras_approach",),
    ),
    Mutant(
        "distances along the ray are taken for z", "semgs/doctor/rig.py",
        "lengths = np.sqrt(1 + (rays**2).sum(-1)) if self.along_ray else 1.0", "lengths = 1.0",
        (f"{OF_DOCTOR}test_a_distance_of_5_m_along_a_ray_of_slope_three_quarters_is_a_depth_of_4_m",),
    ),
    Mutant(
        "a focal length that fits the images is blamed for depth", "semgs/doctor/diagnosis.py",
        "if fits_alone and not (", "if False and not (",
        (f"{OF_DOCTOR}test_depth_of_another_scale_is_not_blamed_on_a_focal_length_that_fits_the_images",),
    ),
    Mutant(
        "the gain of a zoom is not a mean of ratios", "semgs/doctor/registered.py",
        "falls = np.log(before / after)", "falls = before - after",
        ("tests/doctor/test_registered.py::test_the_gain_is_the_geometric_mean_over_pairs",),
    ),
    Mutant(
        "depth maps are compared at the inverse zoom", "semgs/doctor/registered.py",
        "focal=rig.focal * zoom)", "focal=rig.focal / zoom)",
        ("tests/doctor/test_registered.py::test_depth_maps_alone_show_another_focal_length_and_matches_whose",),
    ),
    Mutant(
        "corrected cameras are written with OpenCV's axes", "semgs/doctor/fix.py",
        "(rig.poses[index] @ FLIP).tolist()", "rig.poses[index].tolist()",
        ("tests/cli/scenes/test_doctor_command.py::test_inverted_poses_end_with_3_and_are_corrected",),
    ),
)  # fmt: skip
