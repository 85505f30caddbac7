"""Errors planted in `semgs/ros`."""

from __future__ import annotations

from planted.mutant import Mutant

ROS = (
    Mutant(
        "ROS: w is the first number of a quaternion", "semgs/ros/messages.py",
        "[turn.w, turn.x, turn.y, turn.z]", "[turn.x, turn.y, turn.z, turn.w]",
        ("tests/ros/test_messages_in.py::test_four_messages_have_a_pose",),
    ),
    Mutant(
        "ROS: red and blue are swapped", "semgs/ros/messages.py",
        "pixels_of(image)[..., ::-1]", "pixels_of(image)", ("tests/ros/test_messages_in.py::test_encodings_of_colour",),
    ),
    Mutant(
        "ROS: depth in millimetres is taken as metres", "semgs/ros/messages.py",
        "counts * np.float32(MILLIMETRE)", "counts * np.float32(1)",
        ("tests/ros/test_messages_in.py::test_depth_becomes_metres_and_0_where_unknown",),
    ),
    Mutant(
        "ROS: the plan is in the level frame, not in that of the poses", "semgs/ros/messages.py",
        "frame_from_level = found.level_from_world.T", "frame_from_level = np.eye(3)",
        ("tests/ros/test_messages_out.py::test_if_y_is_down_boxes_and_plan_are_turned_into_the_frame_of_the_poses",),
    ),
    Mutant(
        "ROS: the first row of a plan has the largest y", "semgs/ros/messages.py",
        "found.cells.ravel()", "found.cells[::-1].ravel()",
        ("tests/ros/test_messages_out.py::test_the_grid_is_that_of_the_plan_cell_for_cell_and_the_map_turned_upside_down",),
    ),
)  # fmt: skip
