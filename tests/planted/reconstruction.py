"""Errors planted in `semgs/run` and `semgs/depth_maps`."""

from __future__ import annotations

from planted.mutant import Mutant

VIEW_SCORES = "semgs/objectives/metrics.py"
OF_VIEW_SCORES = ("tests/run/test_scores.py",)

ALIGNMENT = "semgs/depth_maps/alignment.py"
OF_ALIGNMENT = ("tests/depth_maps/test_alignment.py",)

RECONSTRUCTION = (
    Mutant(
        "compiling counts as the stage in which it happens", "semgs/runtime/stopwatch.py",
        "perf_counter() - start - compiled()", "perf_counter() - start", ("tests/runtime/test_stopwatch.py",),
    ),
    Mutant(
        "percent of confidence are rounded to the nearest", "semgs/run/output/files.py",
        "np.floor(100 *", "np.rint(100 *", ("tests/run/output/test_renders.py",),
    ),
    Mutant(
        "errors of depth are averaged over views, not pixels", VIEW_SCORES,
        "sum(getattr(one, part) * one.pixels for one in known)", "sum(getattr(one, part) * pixels / len(known) for one in known)", OF_VIEW_SCORES,
    ),
    Mutant(
        "depth maps are aligned in depth instead of its inverse", ALIGNMENT,
        "values.isfinite() & (values > 0), 1 / values, torch.nan", "values.isfinite() & (values > 0), values, torch.nan", OF_ALIGNMENT,
    ),
    Mutant(
        "views of depth maps are aligned each by itself", ALIGNMENT, "SHARED = 0.05", "SHARED = 0.0",
        ("tests/depth_maps/test_alignment.py::test_a_view_without_a_reference_is_aligned_to_the_other_views",),
    ),
    Mutant(
        "the error of the reference counts as that of the map", ALIGNMENT,
        "variances.append(max(residual**2 - others,", "variances.append(max(residual**2,",
        ("tests/depth_maps/test_alignment.py::test_an_exact_map_is_trusted_beside_a_noisy_reference_and_a_bent_one_less",),
    ),
    Mutant(
        "the less certain depth counts more", "semgs/depth_maps/map_depth.py",
        "(depth > 0) / spread.square().clamp(min=1e-12)", "(depth > 0) * spread.square().clamp(min=1e-12)",
        ("tests/run/test_depth_maps_of_scenes.py",),
    ),
    Mutant(
        "the sensor's own maps are their reference", "semgs/depth_maps/map_depth.py",
        "views.depths if independent else None", "views.depths",
        ("tests/run/test_depth_maps_of_scenes.py::test_the_scenes_own_maps_are_no_reference_for_themselves",),
    ),
    Mutant(
        "counts of a map without a unit are metres", "semgs/depth_maps/map_folder.py", "MILLIMETRE if path.suffix", "1.0 if path.suffix",
        ("tests/depth_maps/test_map_folder.py::test_counts_are_millimetres_or_in_the_stated_unit",),
    ),
    Mutant(
        "DepthPro's field of view is in radians", "semgs/depth_maps/opening.py",
        "torch.tan(torch.deg2rad(found.field_of_view.float()) / 2)", "torch.tan(found.field_of_view.float() / 2)",
        ("tests/depth_maps/test_depth_networks.py::test_depth_pro_takes_its_field_of_view_for_the_focal_length",),
    ),
    Mutant(
        "depth is fitted instead of its inverse", "semgs/depth_maps/depth_fit.py",
        "(1 / depths[known].double() for", "(depths[known].double() for",
        ("tests/depth_maps/test_depth_fit.py::test_scale_and_shift_come_back",),
    ),
    Mutant(
        "outliers vote in the fit", "semgs/depth_maps/depth_fit.py",
        ".clamp(min=0).square()", ".clamp(min=0).square() * 0 + 1",
        ("tests/depth_maps/test_depth_fit.py::test_forty_percent_of_outliers_have_no_vote",),
    ),
    Mutant(
        "the more a sensor is off, the more it counts", "semgs/depth_maps/sensor_depth.py",
        "weights * variance / (variance + noise)", "weights * noise / (variance + noise)",
        ("tests/run/test_sensor_depth.py::test_both_weighs_log_depths_by_their_inverse_variances",),
    ),
    Mutant(
        "depth maps that lie to the right are found to the left", "semgs/depth_maps/sensor_depth.py",
        "margin - right :", "margin + right :",
        ("tests/depth_maps/test_registration.py::test_shifted_depth_is_found_to_within_half_a_window",),
    ),
    Mutant(
        "a gain of exposure darkens towards grey instead of black", "semgs/scene/exposure.py",
        "(0.5 * (gains - 1) + offsets)", "offsets",
        ("tests/scene/test_exposure.py::test_gaussians_get_the_gain_and_offset_of_their_own_photo",),
    ),
    Mutant(
        "the brighter photo gets the larger gain", "semgs/scene/exposure.py",
        "deviations[:, 1] / deviations[:, 0].clamp", "deviations[:, 0] / deviations[:, 1].clamp",
        ("tests/scene/test_exposure.py::test_photos_with_known_exposures_become_equal",),
    ),
    Mutant(
        "photos that are held out say classes too", "semgs/run/steps/splat_labelling.py",
        "return [position for position in range(count) if position not in set(held)], held", "return list(range(count)), held",
        ("tests/run/test_splat_labelling.py::test_one_of_so_many_photos_is_held_out",),
    ),
    Mutant(
        "a splat that looks like no photo is not noticed", "semgs/splats/splat_scene.py",
        "own is None or own > FEW_LIKE_OWN:", "own is None or own >= 0:",
        ("tests/run/test_splat_labelling.py::test_cameras_that_do_not_fit_are_noticed",),
    ),
    Mutant(
        "pixels that a mask hides vote for the classes of a splat", "semgs/run/steps/splat_labelling.py",
        "distributions = distributions.masked_fill(view.hidden, 0)", "pass", ("tests/run/test_splat_labelling.py::test_pixels_that_a_mask_hides_do_not_vote",),
    ),
    Mutant(
        "the difference of two maps is the error of one", "semgs/depth_maps/alignment.py",
        "float(apart.abs().median()) / sqrt(2)", "float(apart.abs().median())", ("tests/depth_maps/test_alignment.py::test_what_two_maps_disagree_is_a_root_of_two_less_than_their_difference",),
    ),
    Mutant(
        "a reference counts the same where it is uncertain", "semgs/depth_maps/alignment.py",
        "/ (sigma.square() + self._spread[view].square())", "/ sigma.square()", ("tests/depth_maps/test_alignment.py::test_the_part_of_a_reference_that_is_uncertain_counts_less",),
    ),
)  # fmt: skip
