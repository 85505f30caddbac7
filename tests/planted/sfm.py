"""Errors planted in `semgs/sfm`."""

from __future__ import annotations

from planted.mutant import Mutant

OF_SFM = "tests/sfm/test_"
OF_REFINE = "tests/sfm/test_camera_refinement.py::"

SFM = (
    Mutant(
        "photos are numbered as their features are found", "semgs/sfm/solving.py",
        "        library.import_images(database, folder, mode, names, reader)\n", "",
        (OF_SFM + "solving.py::test_photos_are_numbered_in_their_order_though_a_later_one_is_done_first",),
    ),
    Mutant(
        "depth of another camera is read at the inverse zoom", "semgs/sfm/matches.py",
        "zooms[:, None] * offsets[:, None]", "offsets[:, None] / zooms[:, None]",
        ("tests/doctor/test_registered.py::test_depth_of_another_camera_in_the_included_room_is_named",),
    ),
    Mutant(
        "epipolar distances are those of angles", "semgs/sfm/camera_refinement.py",
        "np.cross(b, baseline)) / seen.focal[:, 0]", "np.cross(b, baseline)) / seen.focal[:, 1]",
        (f"{OF_REFINE}test_a_match_3_px_below_its_epipolar_line_is_off_by_the_share_of_both_images",),
    ),
    Mutant(
        "epipolar distances are those in one image", "semgs/sfm/camera_refinement.py",
        "np.sqrt((by_first**2).sum(1) + (by_second**2).sum(1))", "np.sqrt((by_second**2).sum(1))",
        (f"{OF_REFINE}test_a_match_3_px_below_its_epipolar_line_is_off_by_the_share_of_both_images",),
    ),
    Mutant(
        "gradients stay in the world", "semgs/sfm/camera_refinement.py",
        '"mji,mj->mi", first[:, :3, :2]', '"mij,mj->mi", first[:, :2, :3]',
        (f"{OF_REFINE}test_the_distance_is_that_by_which_the_pixels_have_to_move",),
    ),
    Mutant(
        "the baseline is between the wrong cameras", "semgs/sfm/camera_refinement.py",
        "second[:, :3, 3] - first[:, :3, 3]", "second[:, :3, 3] + first[:, :3, 3]",
        (f"{OF_REFINE}test_a_match_3_px_below_its_epipolar_line_is_off_by_the_share_of_both_images",),
    ),
    Mutant(
        "matches are squared, so wrong ones win", "semgs/sfm/camera_refinement.py",
        "np.sign(distance) * np.sqrt(np.log1p(distance**2))", "distance",
        (f"{OF_REFINE}test_a_third_of_wrong_matches_does_little_harm",),
    ),
    Mutant(
        "nothing holds the cameras where they are", "semgs/sfm/camera_refinement.py",
        "np.sqrt(np.log1p(distance**2)), step))", "np.sqrt(np.log1p(distance**2)), 0 * step))",
        (f"{OF_REFINE}test_a_match_and_a_usual_error_of_one_degree_weigh_the_same_if_a_degree_moves_it_by_a_pixel",),
    ),
    Mutant(
        "cameras are usually off by one radian", "semgs/sfm/camera_refinement.py",
        "np.radians(TURN_DEG) * turn", "TURN_DEG * turn",
        (f"{OF_REFINE}test_a_match_and_a_usual_error_of_one_degree_weigh_the_same_if_a_degree_moves_it_by_a_pixel",),
    ),
    Mutant(
        "frames are taken in the order of the file", "semgs/sfm/camera_refinement.py",
        "for camera, index in enumerate(frames)}", "for camera, index in enumerate(sorted(frames))}",
        (f"{OF_REFINE}test_matches_become_rays_of_the_frames_in_the_order_given",),
    ),
    Mutant(
        "the focal length is that of the full image", "semgs/sfm/camera_refinement.py",
        "focal * matches.shrink[..., None])", "focal)",
        (f"{OF_REFINE}test_matches_become_rays_of_the_frames_in_the_order_given",),
    ),
    Mutant(
        "any improvement is taken", "semgs/sfm/camera_refinement.py",
        "accepted = after <= FALLS_TO * before", "accepted = True",
        (f"{OF_REFINE}test_good_cameras_stay_and_slightly_wrong_ones_are_corrected",),
    ),
    Mutant(
        "the median of the motion counts", "semgs/sfm/clips.py",
        "axis=1), 1 - MOVING)", "axis=1), 0.5)",
        (f"{OF_SFM}photos.py::test_walking_around_something_moves_what_is_in_front_of_it",),
    ),
    Mutant(
        "stretches of an uneven clip have as many frames", "semgs/sfm/clips.py",
        "if by_time and len(frames) > 1:", "if False:",
        (f"{OF_SFM}photos.py::test_frames_with_uneven_times_are_spread_by_time",),
    ),
    Mutant(
        "the rotation flag of a clip is ignored", "semgs/sfm/clips.py",
        "video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)", "video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)",
        (f"{OF_SFM}photos.py::test_frames_are_turned_as_the_rotation_flag_says",),
    ),
    Mutant(
        "pixels of a turned clip are stretched along the other axis", "semgs/sfm/clips.py",
        "if video.get(cv2.CAP_PROP_ORIENTATION_META) % 180:", "if False:",
        (f"{OF_SFM}photos.py::test_frames_that_are_turned_are_stretched_along_the_axis_they_are_stored_with",),
    ),
    Mutant(
        "models of any error fit equally well", "semgs/sfm/solving.py",
        "<= EQUAL * least]", "<= np.inf]",
        (f"{OF_SFM}solving.py::test_the_best_model_has_the_most_photos_then_the_smallest_error_unless_it_explains_little",),
    ),
    Mutant(
        "a model of a few observations counts", "semgs/sfm/solving.py",
        ">= SHARE * seen", ">= 0",
        (f"{OF_SFM}solving.py::test_the_best_model_has_the_most_photos_then_the_smallest_error_unless_it_explains_little",),
    ),
    Mutant(
        "the least usual focal length comes first", "semgs/sfm/solving.py",
        "abs(np.log(_ratio(model) / GUESS))", "-abs(np.log(_ratio(model) / GUESS))",
        (f"{OF_SFM}solving.py::test_of_models_that_fit_equally_well_the_usual_focal_length_comes_first",),
    ),
    Mutant(
        "estimated poses are world to camera", "semgs/sfm/solving.py",
        "image.cam_from_world().inverse().matrix()", "image.cam_from_world().matrix()",
        (f"{OF_SFM}solving.py::test_colmaps_pixels_and_axes_are_ours_and_its_poses_are_inverted",),
    ),
    Mutant(
        "COLMAP's principal point is taken for OpenCV's", "semgs/sfm/solving.py",
        "(focal, focal), (cx, cy)", "(focal, focal), (cx + 0.5, cy + 0.5)",
        (f"{OF_SFM}solving.py::test_colmaps_pixels_and_axes_are_ours_and_its_poses_are_inverted",),
    ),
    Mutant(
        "estimated cameras are written with OpenCV's axes", "semgs/sfm/scene_folder.py",
        "(photo.world_from_camera @ OPENGL_FROM_OPENCV)", "photo.world_from_camera",
        (f"{OF_SFM}solving.py::test_three_photos_get_their_relative_poses_and_metres",),
    ),
    Mutant(
        "a scale multiplies rotations too", "semgs/sfm/scale.py",
        "pose[:3, 3] *= scale", "pose[:3] *= scale",
        (f"{OF_SFM}solving.py::test_scaling_moves_cameras_and_keeps_their_rotation",),
    ),
    Mutant(
        "a scale is inverted", "semgs/sfm/scale.py",
        "known.metres / distance", "distance / known.metres",
        (f"{OF_SFM}solving.py::test_three_photos_get_their_relative_poses_and_metres",),
    ),
    Mutant(
        "FFmpeg may read lists of other files", "semgs/sfm/clip_headers.py",
        "|format_whitelist;mov,avi,matroska", "", (f"{OF_SFM}clip_containers.py::test_ffmpeg_itself_opens_no_list",),
    ),
)  # fmt: skip
