"""Errors planted in readers of what other programs write, and in what is believed of it."""

from __future__ import annotations

from planted.mutant import Mutant

RVL = "semgs/data/layouts/ros/image_messages.py"
METASHAPE = "semgs/data/layouts/metashape.py"
LLFF = "semgs/data/layouts/llff.py"
SPARSE = "semgs/data/layouts/parts/sparse_points.py"
GROUPS = "semgs/sfm/lens_groups.py"
RANGE = "semgs/data/bounds/depth_range.py"
TRANSFORMS = "semgs/data/layouts/transforms_json.py"
COLMAP = "semgs/data/layouts/colmap/colmap_scene.py"
UNIT = "semgs/doctor/facts.py"
WINDOWS = "semgs/mapping/windows.py"

OF_BAGS = "tests/data/layouts/ros/test_ros_bag.py::test_"
OF_PROGRAMS = "tests/data/layouts/test_cameras_of_programs.py::test_"
OF_SPARSE = "tests/data/layouts/parts/test_sparse_points.py"
OF_GROUPS = "tests/sfm/test_lens_groups.py::test_"
OF_RANGE = "tests/data/bounds/test_depth_range.py::test_"
OF_COLMAP = "tests/data/layouts/colmap/test_colmap.py::test_"
OF_UNIT = "tests/doctor/test_unit.py::test_"
OF_WINDOWS = "tests/mapping/test_windows.py::test_"

OTHER_TOOLS = (
    Mutant(
        "RVL: differences are not zigzag", RVL,
        "(steps >> 1) ^ -(steps & 1)", "steps >> 1", ("tests/data/layouts/ros/test_ros_bag.py",),
    ),
    Mutant(
        "RVL: the first nibble of a number is its highest", RVL,
        "(nibbles & 7) << 3 * places", "(nibbles & 7) << 3 * (places.max() - places)", ("tests/data/layouts/ros/test_ros_bag.py",),
    ),
    Mutant(
        "Metashape: the principal point is from the corner", METASHAPE,
        "(width / 2 + values[\"cx\"], height / 2 + values[\"cy\"])", "(values[\"cx\"], values[\"cy\"])",
        (f"{OF_PROGRAMS}a_point_is_where_metashape_puts_it",),
    ),
    Mutant(
        "Metashape: b1 is of the rows", METASHAPE,
        "(values[\"f\"] + values[\"b1\"], values[\"f\"])", "(values[\"f\"], values[\"f\"] + values[\"b1\"])",
        (f"{OF_PROGRAMS}a_point_is_where_metashape_puts_it",),
    ),
    Mutant(
        "Metashape: a component's scale is left out", METASHAPE,
        "pose[:3, 3] *= scale", "pose[:3, 3] *= 1", (f"{OF_PROGRAMS}a_component_scales_turns_and_moves_its_cameras",),
    ),
    Mutant(
        "Metashape: p1 and p2 are in OpenCV's order", METASHAPE,
        "values[\"p2\"], values[\"p1\"], values[\"k3\"]", "values[\"p1\"], values[\"p2\"], values[\"k3\"]",
        (f"{OF_PROGRAMS}a_point_is_where_metashape_puts_it",),
    ),
    Mutant(
        "LLFF: down is right", LLFF,
        "(matrices[..., 1], matrices[..., 0], -matrices[..., 2]", "(matrices[..., 0], matrices[..., 1], -matrices[..., 2]",
        (f"{OF_PROGRAMS}a_point_is_where_llff_puts_it",),
    ),
    Mutant(
        "LLFF: smaller photos keep the focal length", LLFF,
        "(focal * width / columns_of, focal * height / rows_of)", "(focal, focal)", (f"{OF_PROGRAMS}a_point_is_where_llff_puts_it",),
    ),
    Mutant(
        "sparse points right of the image are in view", SPARSE,
        "(column < width)", "(column < 2 * width)", (OF_SPARSE,),
    ),
    Mutant(
        "of many sparse points the first are used", SPARSE,
        "columns[name][::step]", "columns[name][:MOST]", (OF_SPARSE,),
    ),
    Mutant(
        "lenses: focal lengths that differ by 18 % are of two lenses", GROUPS,
        "SAME = 1.2", "SAME = 1.15",
        (f"{OF_GROUPS}photos_are_grouped_where_focal_lengths_jump_by_more_than_20_percent",),
    ),
    Mutant(
        "lenses: photos that were not solved are a group of their own", GROUPS,
        "(size, None, largest) for name in names", "(size, None, -1) for name in names",
        (f"{OF_GROUPS}photos_are_grouped_where_focal_lengths_jump_by_more_than_20_percent",),
    ),
    Mutant(
        "units: wrong matches on both sides contradict metres", RANGE,
        "return abs(float((inverse > SLACK / near).mean() - (inverse < 1 / (SLACK * far)).mean()))",
        "return float((inverse > SLACK / near).mean() + (inverse < 1 / (SLACK * far)).mean())",
        (f"{OF_RANGE}wrong_matches_on_both_sides_and_few_that_depth_maps_deny_leave_the_range_of_rooms",),
    ),
    Mutant(
        "units: depth maps cannot deny what points say", RANGE,
        "BOTH_CONTRADICT <= share < MOSTLY", "BOTH_CONTRADICT <= share < CONTRADICTS",
        (f"{OF_RANGE}wrong_matches_on_both_sides_and_few_that_depth_maps_deny_leave_the_range_of_rooms",),
    ),
    Mutant(
        "units: sparse depth is a sensor's", TRANSFORMS,
        "np.median(shares) < DENSE", "np.median(shares) < 0", (f"{OF_RANGE}lengths_are_metres_if_a_sensor_seems_to_have_measured_a_room",),
    ),
    Mutant(
        "units: depth of COLMAP's cameras is in metres", TRANSFORMS,
        "if maps and from_colmap else", "if not maps and from_colmap else",
        (f"{OF_RANGE}dense_depth_of_cameras_that_colmap_solved_is_not_in_metres",),
    ),
    Mutant(
        "units: the doctor never doubts depth maps", UNIT,
        "(\"depth maps\", found.depth_ratio, SAME)", "(\"depth maps\", np.nan, SAME)",
        (f"{OF_UNIT}depth_maps_that_differ_from_parallax_contradict_metres_and_any_other_unit",),
    ),
    Mutant(
        "reduced images have the lens of the whole ones", COLMAP,
        "focal=(across * fx, down * fy)", "focal=(fx, fy)", (f"{OF_COLMAP}reduced_images_have_a_reduced_lens_of_any_kind",),
    ),
    Mutant(
        "times in nanoseconds are in seconds", "semgs/data/layouts/parts/trajectories.py",
        "(NANOSECONDS, 1e9), ", "", ("tests/data/layouts/rgbd/test_tum.py::test_times_in_parts_of_a_second_are_those_in_seconds",),
    ),
    Mutant(
        "of two poses at one time the last counts", "semgs/data/layouts/ros/route.py",
        "if fixed or time not in held_at:", "if True:", (f"{OF_BAGS}of_two_poses_at_the_same_time_the_first_counts",),
    ),
    Mutant(
        "Gaussians of a window of three stay shrunk", WINDOWS,
        "unshrunk(encode(members), members.cameras)", "encode(members)",
        (f"{OF_WINDOWS}each_view_has_the_gaussians_of_its_own_window_and_equal_windows_are_encoded_once",),
    ),
    Mutant(
        "a scene that is merged at once has four layers, however many are asked for", WINDOWS,
        "range(len(views)), layers)", "range(len(views)))",
        (f"{OF_WINDOWS}a_surface_has_the_gaussians_of_so_many_views",),
    ),
)  # fmt: skip
