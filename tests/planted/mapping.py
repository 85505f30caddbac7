"""Errors planted in `semgs/mapping`."""

from __future__ import annotations

from planted.mutant import Mutant

MERGING = "semgs/mapping/merging.py"
OF_MERGING = "tests/mapping/test_merging.py::test_"

MAPPING = (
    Mutant(
        "merging: keyframes that see more coarsely go first", MERGING,
        "first = (level < part.level[within])", "first = (level > part.level[within])", (f"{OF_MERGING}keyframes_that_come_closer_replace_those_from_afar",),
    ),
    Mutant(
        "merging: what is hidden counts as a floater", MERGING,
        "part.spread[within], spread) < -TOLERANCE", "part.spread[within], spread).abs() > TOLERANCE",
        (f"{OF_MERGING}what_another_keyframe_looks_through_is_a_floater_and_what_it_cannot_see_is_not",),
    ),
    Mutant(
        "merging: photos are compared at one depth", MERGING,
        "torch.linspace(-REACH, REACH, STEPS)", "torch.linspace(0, 0, STEPS)", (f"{OF_MERGING}gaussians_go_to_a_depth_that_photos_agree_with",),
    ),
    Mutant(
        "merging: what photos contradict stays", MERGING,
        "keep = allowed & (part", "keep = (part", (f"{OF_MERGING}gaussians_that_no_photo_shows_are_dropped",),
    ),
    Mutant(
        "merging: exposure is that of the first photo", MERGING,
        "SAME_COLOUR + exposure(part.sheet, other)", "SAME_COLOUR", (f"{OF_MERGING}a_photo_with_another_exposure_contradicts_nothing",),
    ),
    Mutant(
        "merging: hidden Gaussians are compared with what hides them", MERGING,
        "visible = within & (apart <= TOLERANCE)", "visible = within",
        (f"{OF_MERGING}keyframes_added_one_by_one_are_all_windows_merged_at_once",),
    ),
    Mutant(
        "merging: all keyframes pull alike", MERGING,
        "weight = agrees / (spread.square() + SPREAD**2)", "weight = agrees / (0 * spread + SPREAD**2)", (f"{OF_MERGING}the_surer_keyframe_pulls_more",),
    ),
    Mutant(
        "merging: Gaussians do not grow with their depth", MERGING,
        "gaussians.colour.scales * ratio * thinner", "gaussians.colour.scales * thinner",
        (f"{OF_MERGING}two_keyframes_that_are_equally_sure_meet_in_the_middle",),
    ),
    Mutant(
        "merging: four layers are as thick as two", MERGING,
        "gaussians.colour.scales * ratio * thinner", "gaussians.colour.scales * ratio",
        (f"{OF_MERGING}the_first_four_of_six_equal_keyframes_stay_and_get_thinner",),
    ),
    Mutant(
        "merging: classes are the sum of the logs, not their mean", MERGING,
        "(logs / (1 + votes.agree[:, None])).softmax(-1)", "logs.softmax(-1)",
        (f"{OF_MERGING}keyframes_added_one_by_one_are_all_windows_merged_at_once",),
    ),
    Mutant(
        "voxels: the joint covariance forgets the distance of the means", "semgs/mapping/voxels.py",
        " + offsets[:, :, None] * offsets[:, None]", "", ("tests/mapping/test_voxels.py",),
    ),
    Mutant(
        "keyframes: predicted depth is that of the keyframe, not of the frame", "semgs/mapping/keyframes.py",
        "depths, places = own[inside, 2]", "depths, places = (np.concatenate(points)[:, 2])[: int(inside.sum())]",
        ("tests/mapping/test_keyframes.py::test_predicted_depth_is_that_of_the_wall_from_another_place",),
    ),
    Mutant(
        "keyframes: of several points in a cell the farthest counts", "semgs/mapping/keyframes.py",
        "np.full(GRID * GRID, np.inf)\n    np.minimum.at(", "np.full(GRID * GRID, -np.inf)\n    np.maximum.at(", ("tests/mapping/test_keyframes.py::test_of_two_surfaces_in_a_cell_the_nearer_one_is_predicted",),
    ),
    Mutant(
        "keyframes: rows are shares of the width", "semgs/mapping/keyframes.py",
        "(GRID / width, GRID / height, 1)", "(GRID / width, GRID / width, 1)", ("tests/mapping/test_keyframes.py::test_predicted_cells_are_shares_of_the_height_and_of_the_width",),
    ),
    Mutant(
        "keyframes: the x axis is the way a camera looks", "semgs/mapping/keyframes.py",
        "poses[:, :3, 2] @ pose[:3, 2]", "poses[:, :3, 0] @ pose[:3, 0]", ("tests/mapping/test_keyframes.py::test_the_way_a_camera_looks_is_its_optical_axis",),
    ),
)  # fmt: skip
