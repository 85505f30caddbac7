"""Errors planted in `semgs/rooms`."""

from __future__ import annotations

from planted.mutant import Mutant

ROOMS = (
    Mutant(
        "shaded rooms are added to traced ones", "packages/semgs-rooms/semgs_rooms/sets/room_scenes.py",
        'SHADED = "shaded"', 'SHADED = "traced"',
        ("tests/rooms/sets/test_dataset.py::test_shaded_rooms_of_a_release_that_also_traced_go_on_and_traced_ones_do_not",),
    ),
    Mutant(
        "cameras of the held-out world are used as those in homes", "packages/semgs-rooms/semgs_rooms/sets/carried_cameras.py",
        'if style == "other":', 'if style == "nowhere":',
        ("tests/rooms/sets/test_cameras_of_rooms.py::test_the_held_out_world_has_the_usual_cameras_and_no_number_is_spent_on_it",),
    ),
    Mutant(
        "close cameras are anywhere in the room", "packages/semgs-rooms/semgs_rooms/sets/carried_cameras.py",
        "150, subject)[:60]", "150)[:60]",
        ("tests/rooms/sets/test_cameras_of_rooms.py::test_close_cameras_are_within_90_cm_of_their_subject_and_fill_the_frame_with_it",),
    ),
    Mutant(
        "patterns lose their contrast in close-ups", "packages/semgs-rooms/semgs_rooms/plans/worlds.py",
        "ratio * np.array(base)", "np.array(base)",
        ("tests/rooms/plans/test_closeup.py::test_a_pattern_keeps_its_contrast_and_an_image_its_structure_in_another_colour",),
    ),
    Mutant(
        "close-ups show any piece of furniture", "packages/semgs-rooms/semgs_rooms/sets/carried_cameras.py",
        "subjects=LARGE_SUBJECTS, shares=FILLED", "shares=(0.0, 0.1)",
        ("tests/rooms/plans/test_closeup.py::test_in_most_views_one_piece_fills_more_than_half_of_the_image_which_is_rare_in_homes",),
    ),
    Mutant(
        "a sofa in the room has its front to it", "packages/semgs-rooms/semgs_rooms/plans/home.py",
        "*wall.at(left + width, off + depth), wall.yaw + np.pi,", "*wall.at(left, off), wall.yaw,",
        ("tests/rooms/plans/test_homes.py::test_a_sofa_in_the_room_has_its_back_a_metre_or_more_from_the_wall_behind_it",),
    ),
    Mutant(
        "glazed cabinets hang in windows", "packages/semgs-rooms/semgs_rooms/plans/home.py",
        " or not wall.free(start, end, low, high)", "",
        ("tests/rooms/plans/test_homes.py::test_no_glazed_cabinet_hangs_in_a_window",),
    ),
    Mutant(
        "a washstand's bowl is full of cabinet", "packages/semgs-rooms/semgs_rooms/pieces/kitchen_and_bath.py",
        "(width - 0.01, depth - 0.04, height - 0.19)", "(width - 0.01, depth - 0.04, height - 0.05)",
        ("tests/rooms/pieces/test_kitchen_and_bath.py::test_a_washstand_is_a_sink_in_a_counter_on_a_cabinet",),
    ),
)  # fmt: skip
