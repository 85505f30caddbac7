"""Errors planted in `semgs/data`."""

from __future__ import annotations

from planted.mutant import Mutant

CHOICE = "semgs/data/choosing/choice.py"
COVERAGE = "semgs/data/choosing/coverage.py"
COVISIBILITY = "semgs/data/choosing/covisibility.py"
MAPS = "semgs/data/maps.py"
SCANNET = "semgs/data/layouts/scannet/scannet_scan.py"
SCANNETPP = "semgs/data/layouts/scannetpp/devices.py"
COLMAP = "semgs/data/layouts/colmap/colmap_files.py"
POLYCAM = "semgs/data/layouts/phones/polycam.py"
RECORD3D = "semgs/data/layouts/phones/record3d.py"
OF_CONFINED = "tests/data/test_confined.py::test_"
OF_UPLOADS = "tests/app/test_confined_scenes.py::test_"
OF_COLMAP = ("tests/data/layouts/colmap/test_colmap_files.py",)
OF_FORMULAS = ("tests/data/cameras/test_formula_lens.py",)
OF_COVERAGE = ("tests/data/choosing/test_coverage.py",)
OF_CHOICE = ("tests/data/choosing/test_choice.py",)
OF_COVISIBILITY = ("tests/data/choosing/test_covisibility.py",)


def of_layout(name: str, *tests: str) -> tuple[str, ...]:
    """Tests of a reader below `tests/data/layouts`, by its folder and name ("rgbd/tum")."""
    folder, _, reader = name.rpartition("/")
    return tuple(f"tests/data/layouts/{folder}/test_{reader}.py::test_{test}" for test in tests)


def of_scannet(name: str) -> tuple[str, ...]:
    """A test of ScanNet's reader."""
    return (f"tests/data/layouts/scannet/test_scannet.py::test_{name}",)


def of_scannetpp(name: str) -> tuple[str, ...]:
    """A test of ScanNet++'s reader."""
    return (f"tests/data/layouts/scannetpp/test_scannetpp.py::test_{name}",)


PREDICTIONS = "semgs/data/layouts/predictions"


def of_predictions(*tests: str) -> tuple[str, ...]:
    """Tests of the reader of predicted cameras and depth."""
    return tuple(f"tests/data/layouts/predictions/test_prediction_scene.py::test_{test}" for test in tests)


DATA = (
    Mutant(
        "depth maps that are pointers of Git LFS stay", "semgs/data/layouts/parts/readable_depths.py",
        "_BEGINNING = max(_HEADER, len(LFS_POINTER))", "_BEGINNING = _HEADER",
        ("tests/data/layouts/test_transforms_json.py::test_depth_of_other_kinds_is_left_out_with_a_note",),
    ),
    Mutant(
        "an infinity that Microsoft's printf fills up is a word", "semgs/data/layouts/parts/text_numbers.py",
        r"0*(?:e[+-]\d+)?", "0*",
        ("tests/data/layouts/parts/test_recordings.py::test_what_microsoft_prints_for_nan_and_infinity_is_not_finite",),
    ),
    Mutant(
        "trimesh reads a mesh's comments", "semgs/data/layouts/scannetpp/scannetpp_mesh.py",
        "data = with_plain_header(read_bytes(", "data = bytes(read_bytes(", of_scannetpp("a_mesh_may_have_comments_in_any_encoding"),
    ),
    Mutant(
        "a file whose name has another form of Unicode is missing", "semgs/files/text.py",
        'unicodedata.normalize("NFC", name)', "name", ("tests/data/layouts/parts/test_letter_forms.py",),
    ),
    Mutant(
        "a file found by another form of its name may be outside", "semgs/data/layouts/parts/letter_forms.py",
        'place = named_file(file, folder, found.removesuffix("/"))', 'place = folder / found.removesuffix("/")',
        ("tests/data/layouts/parts/test_letter_forms.py",),
    ),
    Mutant(
        "predicted poses that are world to camera stay so", f"{PREDICTIONS}/predicted.py",
        "return checked if to_world else np.linalg.inv(checked)", "return checked",
        of_predictions("poses_intrinsics_depth_and_images_are_read_as_each_tool_writes_them"),
    ),
    Mutant(
        "the centre of MapAnything's first pixel stays at 0", f"{PREDICTIONS}/tools.py",
        "HALF = 0.5", "HALF = 0.0",
        of_predictions("poses_intrinsics_depth_and_images_are_read_as_each_tool_writes_them"),
    ),
    Mutant(
        "the crop of predicted cameras is undone before their resize", f"{PREDICTIONS}/preprocessing.py",
        "(centre - self.shift) / np.array(self.scale)", "centre / np.array(self.scale) - self.shift",
        ("tests/data/layouts/predictions/test_preprocessing.py::test_the_camera_of_a_photo_undoes_scale_and_shift",),
    ),
    Mutant(
        "VGGT's padding is taken for a crop", f"{PREDICTIONS}/original_photos.py",
        "return bool((images[:, :, [0, -1]] == 255).all())", "return False",
        of_predictions("photos_that_were_padded_are_told_by_the_white_beside_them"),
    ),
    Mutant(
        "predicted depth of low confidence counts", f"{PREDICTIONS}/tools.py",
        "LEAST_CONFIDENCE = 1.5", "LEAST_CONFIDENCE = 1.0",
        of_predictions("poses_intrinsics_depth_and_images_are_read_as_each_tool_writes_them"),
    ),
    Mutant(
        "predicted depth is stretched to the photo without its crop", f"{PREDICTIONS}/prediction_scene.py",
        "carry_over(self.values, self.lens, pixels.lens)", "carry_over(self.values, pixels.lens, pixels.lens)",
        of_predictions("photos_beside_the_file_are_the_frames_and_crop_and_resize_are_undone"),
    ),
    Mutant(
        "predicted poses of the other direction are read", f"{PREDICTIONS}/prediction_scene.py",
        "inverse = np.linalg.inv(world_from_camera)", "inverse = world_from_camera",
        of_predictions("poses_and_depth_that_contradict_each_other_are_refused_with_the_reason"),
    ),
    Mutant(
        "an array of predictions is inflated whatever its size", f"{PREDICTIONS}/npz_file.py",
        "if not self.fits(name):", "if False:",
        of_predictions("an_array_that_inflates_to_more_than_the_limit_is_refused_before_it_is_read"),
    ),
    Mutant(
        "photos of predictions are any photos of the right size", f"{PREDICTIONS}/original_photos.py",
        "likeness < ALIKE", "likeness < -1",
        of_predictions("photos_of_another_number_size_or_content_are_refused"),
    ),
    Mutant(
        "what is none of ScanNet's 20 classes becomes a wall", "semgs/data/tables/class_files.py",
        "labels[number] = IGNORE if name is None", "labels[number] = 0 if name is None",
        ("tests/data/tables/test_class_files.py::test_a_file_may_say_which_of_scannets_classes_a_number_is",),
    ),
    Mutant(
        "images without cameras are scenes to reconstruct", "semgs/data/scenes.py",
        "if needs_cameras and not scene.posed:", "if needs_cameras and not scene.frames:",
        ("tests/data/layouts/test_labelled_images.py::test_without_cameras_it_is_no_scene_to_reconstruct",),
    ),
    Mutant(
        "the centre of ScanNet's first pixel stays at 0", SCANNET,
        "(cx + HALF, cy + HALF)", "(cx, cy)",
        of_scannet("a_point_is_where_scannets_own_formula_puts_it"),
    ),
    Mutant(
        "ScanNet's depth is taken to be the colour camera's", MAPS,
        "carry_over(self.map.metres(), self.lens, self.of_picture or pixels.lens)",
        "fit_to_image(self.map.path, self.map.metres(), pixels.lens.size)",
        of_scannet("a_recording_is_read_as_it_was_written"),
    ),
    Mutant(
        "width and height of a recording change places", "semgs/data/layouts/scannet/sens.py",
        "(depth_height, depth_width),", "(depth_width, depth_height),", of_scannet("a_recording_is_read_as_it_was_written"),
    ),
    Mutant(
        "a count of depth is a millimetre in every recording", "semgs/data/layouts/scannet/sens.py",
        "        1 / shift,\n", "        1e-3,\n", of_scannet("depth_in_fifths_of_a_millimetre_is_read_as_it_was_written"),
    ),
    Mutant(
        "a cut recording is read beyond its end", "semgs/data/layouts/scannet/sens.py",
        "if not colour or start + colour + depth > length:", "if not colour:",
        of_scannet("a_truncated_recording_gives_the_frames_before_the_cut"),
    ),
    Mutant(
        "of rows that share an id the first counts", "semgs/data/layouts/scannet/scannet_labels.py",
        "by_id[identity] = _whole(", "by_id[identity] = by_id.get(identity) or _whole(",
        ("tests/data/tables/test_nyu40.py::test_of_rows_that_share_an_id_the_last_counts",),
    ),
    Mutant(
        "the world of ScanNet++'s transforms.json keeps its axes exchanged", SCANNETPP,
        "back = back[:, [1, 0, 2, 3]]", "back = back[:, [0, 1, 2, 3]]", of_scannetpp("a_matrix_goes_to_the_meshs_world_and_axes"),
    ),
    Mutant(
        "the world of ScanNet++'s transforms.json stays upside down", SCANNETPP,
        "back[:, 2] *= -1", "back[:, 2] *= 1", of_scannetpp("a_matrix_goes_to_the_meshs_world_and_axes"),
    ),
    Mutant(
        "Aria's tangential distortion acts on the rays before the radial one", "semgs/data/cameras/formula_lens.py",
        "    a, b = a * radial, b * radial\n", "    a, b = a * 1.0, b * 1.0\n", OF_FORMULAS,
    ),
    Mutant(
        "FULL_OPENCV takes its coefficients one after the other", "semgs/data/cameras/formula_lens.py",
        "k1, k2, p1, p2, k3, k4, k5, k6 = values\n    r2", "k1, k2, k3, k4, k5, k6, p1, p2 = values\n    r2", OF_FORMULAS,
    ),
    Mutant(
        "a division multiplies the place in the image", "semgs/data/cameras/formula_lens.py",
        "factor = 2 / (1 + np.sqrt(1 - 4 * k * (x * x + y * y)))", "factor = 1 + k * (x * x + y * y)", OF_FORMULAS,
    ),
    Mutant(
        "a fisheye goes by the tangent of the angle", "semgs/data/cameras/formula_lens.py",
        "np.where(r > 1e-9, np.arctan(r) / np.maximum(r, 1e-9), 1.0)", "np.ones_like(r)", OF_FORMULAS,
    ),
    Mutant(
        "lenses of COLMAP's formulas are half a pixel off", "semgs/data/cameras/formula_lens.py",
        "self.focal[0] * u + self.centre[0] - HALF", "self.focal[0] * u + self.centre[0]", OF_FORMULAS,
    ),
    Mutant(
        "the pinhole of such a lens has pixels that no photo shows", "semgs/data/cameras/formula_lens.py",
        "(left[:, 0].max(), right[:, 0].min())", "(left[:, 0].min(), right[:, 0].max())", OF_FORMULAS,
    ),
    Mutant(
        "a lens of half a turn becomes a pinhole", "semgs/data/cameras/lens.py",
        "(enlarged < 1 / _MOST_REDUCED)", "(enlarged < 0)",
        ("tests/data/layouts/colmap/test_colmap.py::test_a_lens_that_no_pinhole_shows_is_refused_with_what_to_do",),
    ),
    Mutant(
        "COLMAP's model 15 is another one", "semgs/data/layouts/colmap/colmap_files.py",
        '"SIMPLE_FISHEYE": ("f", "cx", "cy"),\n    "FISHEYE": ("fx", "fy", "cx", "cy"),',
        '"FISHEYE": ("fx", "fy", "cx", "cy"),\n    "SIMPLE_FISHEYE": ("f", "cx", "cy"),',
        ("tests/data/layouts/colmap/test_colmap_files.py",),
    ),
    Mutant(
        "a fisheye is handed to OpenCV with COLMAP's principal point", "semgs/data/cameras/lens.py",
        "(self.centre[0] - self._half, self.centre[1] - self._half)", "self.centre", of_scannetpp("a_fisheye_is_undone_to_a_tenth_of_a_pixel"),
    ),
    Mutant(
        "of objects that share a vertex the largest counts", "semgs/data/layouts/scannetpp/scannetpp_mesh.py",
        "groups.append((-int(sizes", "groups.append((int(sizes",
        of_scannetpp("of_objects_that_share_a_vertex_the_smallest_counts_even_if_it_has_no_label"),
    ),
    Mutant(
        "rays are cast through the corners of pixels", "semgs/data/layouts/parts/mesh_maps.py",
        "np.stack((column + 0.5, row + 0.5,", "np.stack((column, row,", of_scannetpp("the_phones_frames_are_read_as_they_were_written"),
    ),
    Mutant(
        "what a mask hides keeps its depth", "semgs/data/frames.py",
        "depths.masked_fill(view.hidden, 0)", "depths",
        of_scannetpp("the_phones_frames_are_read_as_they_were_written"),
    ),
    Mutant(
        "quaternions of trajectories are read with w first", "semgs/data/layouts/parts/trajectories.py",
        "x, y, z, w = np.where(", "w, x, y, z = np.where(", of_layout("rgbd/tum", "what_is_read_equals_what_was_written"),
    ),
    Mutant(
        "the centre of the first pixel of a calibration stays at 0", "semgs/data/layouts/parts/calibrations.py",
        "(cx + HALF, cy + HALF)", "(cx, cy)", of_layout("rgbd/tum", "a_point_is_where_the_benchmarks_formula_puts_it"),
    ),
    Mutant(
        "association takes the first in time, not the nearest", "semgs/data/layouts/parts/trajectories.py",
        "(abs(first[i] - second[j]), i, int(j))", "(second[j], i, int(j))",
        of_layout("rgbd/tum", "association_takes_the_nearest_first_and_each_once"),
    ),
    Mutant(
        "the principal point of Replica counts from the centre of the first pixel", "semgs/data/layouts/replica/sequence.py",
        "(width / 2, row * height)", "((width - 1) / 2, row * height)", of_layout("replica/replica", "a_point_is_where_the_renderer_puts_it"),
    ),
    Mutant(
        "files are sorted by name, 10 before 2", "semgs/data/layouts/parts/usable_frames.py",
        "for number in sorted(found)}", "for number in sorted(found, key=str)}",
        ("tests/data/layouts/parts/test_recordings.py::test_files_are_in_the_order_of_their_numbers",),
    ),
    Mutant(
        "depth of 7-Scenes is taken to be the colour camera's", "semgs/data/layouts/rgbd/frame_files.py",
        "        depth_lens = KINECT_DEPTH\n", "        depth_lens = None\n",
        of_layout("rgbd/frame_files", "7_scenes_has_colour_of_525_and_depth_of_585_about_the_same_middle"),
    ),
    Mutant(
        "the largest count of a depth map is a depth", MAPS,
        "FARTHEST if counts.dtype.kind == \"f\" else np.iinfo(counts.dtype).max", "np.inf", of_layout("rgbd/frame_files", "what_is_read_equals_what_was_written"),
    ),
    Mutant(
        "maps are cropped from the corner, pictures about the middle", MAPS,
        "values[top : top + height, left : left + width]", "values[:height, :width]",
        ("tests/data/test_maps.py::test_a_map_is_cropped_and_resized_as_the_picture_is",),
    ),
    Mutant(
        "SUN3D's depth stays rotated", MAPS,
        "(counts >> 3) | (counts << 13)", "counts", of_layout("rgbd/rgbd", "what_is_read_equals_what_was_written"),
    ),
    Mutant(
        "a moving frame has the pose before, not one between", "semgs/data/layouts/ros/motions.py",
        "np.where(span > 0, (times - self.times[before]) / np.maximum(span, 1), 0.0)[:, None]", "np.zeros((len(times), 1))",
        of_layout("ros/ros_bag", "what_is_read_equals_what_was_written"),
    ),
    Mutant(
        "frames are chained from the world down", "semgs/data/layouts/ros/motions.py",
        "poses = step.at(times) @ poses", "poses = poses @ step.at(times)",
        of_layout("ros/ros_bag", "odometry_moves_the_base_that_the_camera_stands_on"),
    ),
    Mutant(
        "pictures of a bag are at the time at which they were recorded", "semgs/data/layouts/ros/bag.py",
        "stamp = stamp_of(message)", "stamp = logged",
        of_layout("ros/ros_bag", "what_is_read_equals_what_was_written"),
    ),
    Mutant(
        "raw pictures of a bag have the camera of rectified ones", "semgs/data/layouts/ros/camera.py",
        "p.reshape(3, 4)[:, :3] if projected else k.reshape(3, 3)", "p.reshape(3, 4)[:, :3]",
        of_layout("ros/ros_bag", "a_point_is_where_opencvs_formula_puts_it"),
    ),
    Mutant(
        "a region of interest leaves the principal point where it was", "semgs/data/layouts/ros/camera.py",
        "(matrix[0, 2] + HALF - x) / bins[0]", "(matrix[0, 2] + HALF) / bins[0]",
        of_layout("ros/ros_bag", "binning_and_regions_of_interest_move_the_camera"),
    ),
    Mutant(
        "red and blue change places in a bag", "semgs/data/layouts/ros/image_messages.py",
        '"rgb8": (3, cv2.COLOR_RGB2BGR), "bgr8": (3, None)', '"rgb8": (3, None), "bgr8": (3, None)',
        of_layout("ros/ros_bag", "pixels_of_all_encodings_are_what_they_say"),
    ),
    Mutant(
        "Polycam's axes are taken as OpenCV's", POLYCAM,
        "* (1, -1, -1, 1)", "* (1, 1, 1, 1)", of_layout("phones/polycam", "a_point_is_where_arkits_axes_and_pixels_put_it"),
    ),
    Mutant(
        "half a pixel is added to Polycam's principal point", POLYCAM,
        "(cx, cy), size", "(cx + 0.5, cy + 0.5), size",
        of_layout("phones/polycam", "a_point_is_where_arkits_axes_and_pixels_put_it"),
    ),
    Mutant(
        "depth belongs to Polycam's corrected images", POLYCAM,
        "raw.get(time) if optimised else None", "None",
        of_layout("phones/polycam", "corrected_images_have_the_depth_of_the_uncorrected_camera_along_their_rays"),
    ),
    Mutant(
        "a high blur score means blur", POLYCAM,
        "if scores[time] >= least}", "if scores[time] <= least}",
        of_layout("phones/polycam", "blurred_frames_and_missing_files_are_left_out_and_counted"),
    ),
    Mutant(
        "the position comes first in Record3D's poses", RECORD3D,
        "table[:, [4, 5, 6, 0, 1, 2, 3]]", "table",
        of_layout("phones/record3d", "a_point_is_where_the_quaternion_and_the_columns_of_k_put_it"),
    ),
    Mutant(
        "Record3D's axes are taken as OpenCV's", RECORD3D,
        "* (1, -1, -1, 1)", "* (1, 1, 1, 1)",
        of_layout("phones/record3d", "a_point_is_where_the_quaternion_and_the_columns_of_k_put_it"),
    ),
    Mutant(
        "Record3D's K is read row by row", RECORD3D,
        "columns[:, [0, 4, 6, 7]]", "columns[:, [0, 4, 2, 5]]",
        of_layout("phones/record3d", "a_point_is_where_the_quaternion_and_the_columns_of_k_put_it"),
    ),
    Mutant(
        "width and height of Record3D's depth change places", RECORD3D,
        "LzfseFile(file, size), 1.0", "LzfseFile(file, size[::-1]), 1.0",
        of_layout("phones/record3d", "what_is_read_equals_what_was_written"),
    ),
    Mutant(
        "depth of low confidence counts", MAPS,
        "depths[self._confidences(self.confidence, depths.shape) == 0] = 0", "pass",
        of_layout("phones/polycam", "depth_of_low_confidence_is_unknown"),
    ),
    Mutant(
        "the translation of a COLMAP pose is that of the camera in the world", COLMAP,
        "= rotations, -rotations @ values[:, 4:, None]", "= rotations, values[:, 4:, None]", OF_COLMAP,
    ),
    Mutant(
        "the counts of a COLMAP file are believed", COLMAP, "if count > (len(data) - _COUNT.size) // least:", "if False:", OF_COLMAP,
    ),
    Mutant(
        "tracks of COLMAP points are read by the points of images", COLMAP, '"<u4")[::2]', '"<u4")[1::2]', OF_COLMAP,
    ),
    Mutant(
        "another aspect is cropped from the left, not about the middle", "semgs/data/resampling.py",
        "(old[1] - columns) // 2", "0",
        ("tests/data/test_views.py::test_another_aspect_is_cropped_about_the_middle_and_never_stretched",),
    ),
    Mutant(
        "a far scene is moved twice as far as its origin", "semgs/data/scene.py",
        "views.cameras.relative_to(self.origin)", "views.cameras.relative_to(2 * self.origin)",
        ("tests/run/test_reconstruct.py",),
    ),
    Mutant(
        "views twice as far apart are preferred", CHOICE,
        "IDEAL_BASELINE = (0.05, 0.15)", "IDEAL_BASELINE = (0.1, 0.3)", OF_CHOICE,
    ),
    Mutant(
        "the preference for a baseline falls off half as fast", CHOICE, "STEEPNESS = 0.72", "STEEPNESS = 1.44", OF_CHOICE,
    ),
    Mutant(
        "scenes are read at the size of their pictures unless somebody asks", "semgs/data/scene.py",
        "return default_size(first.lens.size)", "return None", ("tests/data/test_scenes.py",),
    ),
    Mutant(
        "views that share nothing may go in together", CHOICE, "LEAST_SHARED = 0.3", "LEAST_SHARED = 0.0", OF_CHOICE,
    ),
    Mutant(
        "a held-out view may look elsewhere", CHOICE, "WELL_SEEN = 0.9", "WELL_SEEN = 0.5", OF_CHOICE,
    ),
    Mutant(
        "baselines are judged at the middle of near and far though depth is known", CHOICE,
        "preference(together.relative_baselines)", "preference(together.baselines / 5**0.5)", OF_CHOICE,
    ),
    Mutant(
        "one of four frames is held out", COVERAGE, "EVERY = 8", "EVERY = 4", OF_COVERAGE,
    ),
    Mutant(
        "a photo from the place of another is used, too", COVERAGE,
        "SAME_PLACE, SAME_VIEW = 0.002", "SAME_PLACE, SAME_VIEW = 0.0", OF_COVERAGE,
    ),
    Mutant(
        "parts of a room that share nothing with the first are left out", COVERAGE,
        "        chosen += pair\n", "        chosen += pair[:0]\n", OF_COVERAGE,
    ),
    Mutant(
        "close-ups count as much as other frames", CHOICE, "CLOSE_UP = 0.95", "CLOSE_UP = 0.1", OF_CHOICE,
    ),
    Mutant(
        "what two frames share is the larger of both directions", COVISIBILITY,
        "return np.minimum(seen, seen.T)", "return np.maximum(seen, seen.T)", OF_COVISIBILITY,
    ),
    Mutant(
        "depth that is not known is a depth of 0", COVISIBILITY,
        "np.where(middles > 0, middles, np.nan)", "middles", OF_COVISIBILITY,
    ),
    Mutant(
        "a wall in front hides nothing", COVISIBILITY, "HIDDEN = 1.1", "HIDDEN = 100", OF_COVISIBILITY,
    ),
    Mutant(
        "weights do not say who taught them", "semgs/data/origin/licences.py",
        "    if labeller is None:\n        return own\n", "    return own\n",
        ("tests/segmenters/test_relabelling.py::test_a_student_has_the_terms_of_its_teacher_and_rooms_stay_rooms",),
    ),
    Mutant(
        "sparse points behind a frame are in view", "semgs/data/layouts/parts/sparse_points.py",
        "(depth > 0) & (column >= 0)", "(column >= 0)",
        ("tests/data/layouts/parts/test_sparse_points.py::test_points_in_view_are_those_in_front_and_inside",),
    ),
    Mutant(
        "a black border ends where a photo is still dark", "semgs/data/borders.py",
        "max(1) >= LIT", "max(1) >= 0", ("tests/data/test_borders.py::test_a_photo_that_fades_to_black_has_no_border",),
    ),
    Mutant(
        "the last pixels of a border, half black, are shown", "semgs/data/resampling.py",
        "@ columns.mT > 0,", "@ columns.mT > 0.5,",
        ("tests/data/test_views.py::test_a_pixel_is_hidden_if_a_hidden_one_takes_part_in_its_colour",),
    ),
    Mutant(
        "names may leave a confined folder and come back", "semgs/data/confined.py",
        "if depth < 0 or len(part", "if len(part", (f"{OF_CONFINED}names_that_lead_outside_are_refused_before_anything_there_is_touched",),
    ),
    Mutant(
        "links lead out of a confined folder", "semgs/data/confined.py",
        "place = path.resolve()", "place = path.absolute()",
        (f"{OF_CONFINED}links_inside_are_followed_and_those_that_lead_outside_are_not",),
    ),
    Mutant(
        "TUM's list may name any depth map of the server", "semgs/data/layouts/rgbd/tum.py",
        "named_file(path / DEPTH, path, depths[other])", "(path / depths[other])",
        (f"{OF_UPLOADS}an_honest_scene_is_read_and_a_name_that_leads_outside_touches_nothing_there",),
    ),
    Mutant(
        "the files of an opened scene are not checked again", "semgs/data/scenes.py",
        "    check_inside(path, scene)\n", "", (f"{OF_UPLOADS}a_link_out_of_the_scene_is_refused_wherever_it_comes_from",),
    ),
    Mutant(
        "inverted poses in arrays pass", "semgs/data/array_checks.py",
        "pass their inverse\": np.linalg.inv,", "pass their inverse\": np.asarray,", ("tests/data/test_array_checks.py",),
    ),
    Mutant(
        "the background of renderers is a measurement", "semgs/data/maps.py",
        "FARTHEST = 65504.0", "FARTHEST = 1e30", ("tests/data/test_maps.py",),
    ),
)  # fmt: skip
