"""Errors planted in `semgs/rendering`."""

from __future__ import annotations

from planted.mutant import Mutant

REFERENCE = "semgs/rendering/reference.py"
RENDER = "semgs/rendering/render.py"
PINHOLE = "semgs/rendering/splats.py"
RULES = "semgs/rendering/rules.py"
PROJECTION = "semgs/rendering/projection_kernels.py"
GSPLAT = "semgs/rendering/gsplat_backend.py"
OF_PINHOLE = ("tests/rendering/test_pinhole.py",)
OF_ONE_GAUSSIAN = ("tests/rendering/test_reference.py::test_one_gaussian_on_the_axis_is_what_the_formula_says",)
OF_JACOBIAN = (
    "tests/rendering/test_reference.py::test_the_jacobian_sees_the_position_clamped_to_the_image_and_15_percent",
    "tests/rendering/test_reference.py::test_a_clamped_gaussian_beside_the_image_is_drawn_with_the_clamped_covariance",
)
OF_ASIDE = ("tests/rendering/test_aside.py",)
OF_CLASS_MAP = ("tests/rendering/test_render.py::test_the_class_map_sums_to_one_at_every_pixel_empty_ones_too",)
OF_GSPLAT = ("tests/rendering/test_gsplat_backend.py",)
OF_CONFIDENCE = ("tests/scene/test_confidence.py",)
OF_KERNELS = ("tests/rendering/test_numba_backend.py::test_numba_equals_the_reference_in_float64",)

RENDERING = (
    Mutant(
        "the camera of splatting turns the wrong way", PINHOLE,
        "axes=pose[:3, :3].mT", "axes=pose[:3, :3]", OF_PINHOLE,
    ),
    Mutant(
        "the Jacobian's limits take height for width", PINHOLE,
        "margin_x, margin_y = CLAMP_MARGIN * width, CLAMP_MARGIN * height",
        "margin_x, margin_y = CLAMP_MARGIN * height, CLAMP_MARGIN * width", OF_PINHOLE,
    ),
    Mutant(
        "the principal point is the middle of the picture", PINHOLE,
        "principal_px=(float(k[0, 2]), float(k[1, 2]))", "principal_px=(camera.size[1] / 2, camera.size[0] / 2)",
        OF_PINHOLE,
    ),
    Mutant(
        "the near plane is the near bound", PINHOLE,
        "return NEAR_FRACTION * near", "return near", OF_PINHOLE,
    ),
    Mutant(
        "the back Gaussian is drawn before the front one", REFERENCE,
        "drawn[torch.argsort(depths[drawn], stable=True)]", "drawn[torch.argsort(-depths[drawn], stable=True)]", ("tests/rendering/test_reference.py::test_the_front_gaussian_hides_the_back_one_whatever_their_order",),
    ),
    Mutant(
        "light falls before a Gaussian is added", REFERENCE,
        "(alpha * light[:, :-1]) @ features", "(alpha * light[:, 1:]) @ features", OF_ONE_GAUSSIAN,
    ),
    Mutant(
        "a Gaussian falls off linearly", REFERENCE,
        "torch.exp(-sigma)", "(1 - sigma).clamp(min=0)", OF_ONE_GAUSSIAN,
    ),
    Mutant(
        "the Jacobian is not clamped outside the picture", REFERENCE,
        "clamped = slopes.clamp(limits[:, 0], limits[:, 1])", "clamped = slopes", OF_JACOBIAN,
    ),
    Mutant(
        "the Jacobian forgets depth's row", REFERENCE,
        "-clamped[..., None]), dim=-1)", "0 * clamped[..., None]), dim=-1)", OF_JACOBIAN,
    ),
    Mutant(
        "no blur is added to a projected Gaussian", REFERENCE,
        "+ BLUR_PX2 * torch.eye(2)", "+ 0 * torch.eye(2)", OF_ONE_GAUSSIAN,
    ),
    Mutant(
        "the pixel that is full takes one Gaussian more", REFERENCE,
        "torch.cumprod(1 - alpha.detach(), dim=1) > MIN_TRANSMITTANCE",
        "torch.cumprod(1 - alpha.detach(), dim=1) > MIN_TRANSMITTANCE**2", ("tests/rendering/test_reference.py::test_a_pixel_is_finished_before_transmittance_would_fall_to_1e_4_and_stays_so",),
    ),
    Mutant(
        "alpha may reach 0.99 only", RULES, "MAX_ALPHA = 0.999", "MAX_ALPHA = 0.99",
        ("tests/rendering/test_reference.py::test_no_alpha_exceeds_0_999",),
    ),
    Mutant(
        "the background is ignored", RENDER,
        "colour.transmittance.to(dtype) * background[:, None, None]", "0 * colour.transmittance.to(dtype) * background[:, None, None]",
        ("tests/rendering/test_render.py::test_weights_and_transmittance_sum_to_one",),
    ),
    Mutant(
        "classes are drawn with the shapes of colour", RENDER,
        "classes = splat(scene.semantic, scene.semantic.features)", "classes = splat(scene.colour, scene.semantic.features)",
        ("tests/rendering/test_render.py::test_colour_does_not_know_the_semantic_covariances",),
    ),
    Mutant(
        "light that passes is not spread over the classes", RENDER,
        "semantics = classes.picture + (classes.transmittance / len(classes.picture)).to(dtype)", "semantics = classes.picture",
        OF_CLASS_MAP,
    ),
    Mutant(
        "the light of the colour pass is spread over the classes", RENDER,
        "(classes.transmittance / len(classes.picture))", "(colour.transmittance / len(classes.picture))", OF_CLASS_MAP,
    ),
    Mutant(
        "rendered depth is not divided by the weights", RENDER,
        "colour.picture[3] / torch.where(seen, alphas, 1)", "colour.picture[3]", OF_ASIDE,
    ),
    Mutant(
        "rendered depth is a distance", RENDER,
        "depths = offsets @ camera.axes[2].to(offsets)", "depths = offsets.norm(dim=-1)", OF_ASIDE,
    ),
    Mutant(
        "colour is seen from the other side", RENDER,
        "torch.nn.functional.normalize(offsets, dim=-1)", "torch.nn.functional.normalize(-offsets, dim=-1)", OF_ASIDE,
    ),
    Mutant(
        "autocast reaches into rendering", RENDER,
        "with torch.autocast(device.type, enabled=False):", "with torch.autocast(device.type, enabled=torch.is_autocast_enabled(device.type)):",
        OF_GSPLAT,
    ),
    Mutant(
        "gsplat is given camera-to-world", GSPLAT, "view[:3, :3] = camera.axes", "view[:3, :3] = camera.axes.mT", OF_GSPLAT,
    ),
    Mutant(
        "gsplat takes fx for fy", GSPLAT,
        "[[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]]", "[[[fx, 0, cx], [0, fx, cy], [0, 0, 1]]]", OF_GSPLAT,
    ),
    Mutant(
        "a compiled gradient misses the clamp of the Jacobian", PROJECTION,
        "if camera[16] <= x / z <= camera[17]:", "if True:", OF_KERNELS,
    ),
    Mutant(
        "a compiled gradient of rotations has a wrong sign", PROJECTION,
        "(vw - along * w) / norm", "(vw + along * w) / norm", OF_KERNELS,
    ),
    Mutant(
        "compiled kernels swap the principal point", PROJECTION,
        "u = camera[12] * x / z + camera[14]", "u = camera[12] * x / z + camera[15]", OF_KERNELS,
    ),
    Mutant(
        "a temperature multiplies", "semgs/rendering/temperatures.py",
        "(logarithms(distributions) / temperature)", "(logarithms(distributions) * temperature)", OF_CONFIDENCE,
    ),
    Mutant(
        "unseen pixels may be unknown", "semgs/rendering/rendering.py",
        "    labels[_unseen(rendering)] = UNSEEN\n", "    labels[_unseen(rendering) & (labels != UNKNOWN)] = UNSEEN\n",
        ("tests/figures/test_classes_picture.py",),
    ),
    Mutant(
        "the spread of rendered depth forgets that depths are apart", "semgs/rendering/render_features.py",
        "torch.stack((log, log.square() + depth_spread.square()), 1)", "torch.stack((0 * log, depth_spread.square()), 1)",
        ("tests/rendering/test_rendered_depth_spread.py::test_a_pixel_of_two_depths_has_the_spread_of_both_and_that_between_them",),
    ),
    Mutant(
        "rendered images are brighter than 1", "semgs/rendering/render.py",
        "images = images.clamp(0, 1)", "images = images.clamp(min=0)",
        ("tests/rendering/test_render.py::test_images_lie_in_0_to_1_unless_a_loss_asks_for_them_as_they_are",),
    ),
    Mutant(
        "rendered features are not divided by the weights", "semgs/rendering/render_features.py",
        "torch.cat(pictures) / alphas.clamp(min=LEAST_ALPHA)", "torch.cat(pictures)",
        ("tests/rendering/test_feature_rendering.py::test_the_front_counts_by_its_alpha_and_the_back_by_what_is_left",),
    ),
    Mutant(
        "features are splatted with the shapes of colour", "semgs/rendering/render_features.py",
        "shape = scene.semantic or scene.colour", "shape = scene.colour",
        ("tests/rendering/test_feature_rendering.py::test_features_equal_the_reference_pass_for_pass",),
    ),
    Mutant(
        "gradients pass where alpha is cut off", "semgs/rendering/tile_kernels.py",
        "v_alpha if (opacity * falloff <= MAX_ALPHA) & (alpha > 0) else 0.0", "v_alpha if alpha > 0 else 0.0", ("tests/rendering/test_reference.py::test_there_is_no_gradient_where_the_opacity_of_a_pixel_is_cut_off",),
    ),
    Mutant(
        "depths whose leading bits are equal are not sorted again", "semgs/rendering/numba_backend.py",
        "if shift and bool((depths[order].diff() < 0).any()):", "if False:", ("tests/rendering/test_numba_backend.py::test_depths_whose_leading_bits_are_equal_are_still_in_order",),
    ),
)  # fmt: skip
