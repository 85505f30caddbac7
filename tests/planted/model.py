"""Errors planted in `semgs/model`."""

from __future__ import annotations

from planted.mutant import Mutant

ATTENTION = "semgs/model/attention/camera_attention.py"
SWIN = "semgs/model/attention/transformer.py"
COST = "semgs/model/sweep/cost_volume.py"
HEADS = "semgs/model/gaussians/heads.py"
PLACING = "semgs/model/gaussians/placing.py"
SCENE = "semgs/model/layers/network_input.py"
OVERLAP = "semgs/scene/overlap.py"
CORRELATION = "semgs/model/sweep/correlation_kernels.py"
OF_ATTENTION = ("tests/model/attention/test_camera_attention.py",)
OF_SWIN = ("tests/model/attention/test_swin.py",)
OF_COST = ("tests/model/sweep/test_cost_volume.py::test_the_cost_equals_a_loop_over_pixels_and_planes",)
OF_UNSEEN = ("tests/model/sweep/test_unseen.py",)
OF_PROJECTIONS = ("tests/model/sweep/test_projections.py",)
OF_PLACEMENT = ("tests/model/gaussians/test_placement.py",)
OF_OVERLAP = ("tests/scene/test_overlap.py",)
OF_NEAREST = ("tests/scene/test_nearest.py",)
OF_NETWORK = ("tests/model/test_semgs.py::test_each_pixel_becomes_a_gaussian_on_its_ray",)
OF_PRECISION = ("tests/runtime/test_precision.py",)

OF_LOOKS = ("tests/model/classes/test_looks.py",)
OF_CACHE = ("tests/model/classes/test_view_cache.py",)

MODEL = (
    Mutant(
        "what a second look finds stays mirrored", "semgs/model/classes/semantic.py",
        "in_full(logits).softmax(1).flip(-1)", "in_full(logits).softmax(1)", OF_LOOKS,
    ),
    Mutant(
        "a second look is at an image that the backbone averages down", "semgs/model/classes/semantic.py",
        "CLOSER if round(CLOSER * min(read) / MULTIPLE) * MULTIPLE <= LARGEST else most", "CLOSER", OF_LOOKS,
    ),
    Mutant(
        "two looks are summed instead of averaged", "semgs/model/classes/semantic.py",
        "((in_full(first).softmax(1) + second) / 2)", "(in_full(first).softmax(1) + second)", OF_LOOKS,
    ),
    Mutant(
        "views in a cache are forgotten in the order in which they came", "semgs/model/classes/view_cache.py",
        "self._known.move_to_end(key)", "self._known[key]", OF_CACHE,
    ),
    Mutant(
        "of several new views in a cache, each gets what another one shows", "semgs/model/classes/view_cache.py",
        "computed[place : place + 1]", "computed[position : position + 1]", OF_CACHE,
    ),
    Mutant(
        "the single pass looks twice", "semgs/run/reconstruct.py",
        "1 if self.refine == 0 or self.segmenting.replaces else", "1 if self.segmenting.replaces else",
        ("tests/cli/scenes/test_reconstruct_command.py::test_photos_are_looked_at_twice_if_nothing_else_was_asked",),
    ),
    Mutant(
        "the plain sweep samples half a texel off", COST,
        "((2 * u + 1) / w - 1, (2 * v + 1) / h - 1)", "(2 * u / w - 1, 2 * v / h - 1)", OF_COST,
    ),
    Mutant(
        "the cost is the mean over all other views, seen or not", COST,
        "return (sums / count.clamp(min=1))", "return (sums / (v - 1))", OF_COST,
    ),
    Mutant(
        "the cost is not divided by the root of the channels", COST,
        ".sum(2) / math.sqrt(c)", ".sum(2)", OF_COST,
    ),
    Mutant(
        "what is behind a camera counts as seen, plain", COST,
        "visible = (z > limit) & (u >= -0.5)", "visible = (u >= -0.5)", OF_UNSEEN,
    ),
    Mutant(
        "the compiled sweep swaps its bilinear weights", CORRELATION,
        "wx0, wx1, wy0, wy1 = 1 - a, a, 1 - b, b", "wx0, wx1, wy0, wy1 = a, 1 - a, 1 - b, b",
        ("tests/model/sweep/test_cost_volume.py::test_the_fused_kernel_equals_the_plain_form_in_value_and_gradient",),
    ),
    Mutant(
        "what is behind a camera counts as seen, compiled", CORRELATION,
        "inside = z > smallest[i] and -0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5\n                seen[",
        "inside = -0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5\n                seen[", OF_UNSEEN,
    ),
    Mutant(
        "keys get G^T for G^-1", ATTENTION,
        "return self._apply(k, self.inverse.mT, 1)", "return self._apply(k, self.projection, 1)", OF_ATTENTION,
    ),
    Mutant(
        "the output is not multiplied by G", ATTENTION,
        "return self._apply(o, self.projection.mT, -1) if self.output else o", "return o", OF_ATTENTION,
    ),
    Mutant(
        "rows and columns change places in the rotary angles", ATTENTION,
        "torch.cat((by_column, by_column, by_row, by_row), dim=-1)", "torch.cat((by_row, by_row, by_column, by_column), dim=-1)",
        OF_ATTENTION,
    ),
    Mutant(
        "the rotary rotation runs the other way", ATTENTION,
        "value=sign", "value=-sign", OF_ATTENTION,
    ),
    Mutant(
        "focal lengths are divided by the wrong side", ATTENTION,
        "fx, fy = k[..., 0, 0] / width, k[..., 1, 1] / height", "fx, fy = k[..., 0, 0] / height, k[..., 1, 1] / width",
        OF_PROJECTIONS,
    ),
    Mutant(
        "the principal point is measured from the corner in attention", ATTENTION,
        "k[..., 0, 2] / width - 0.5", "k[..., 0, 2] / width", OF_PROJECTIONS,
    ),
    Mutant(
        "attention's cameras are camera-to-world", ATTENTION,
        "there, back = camera_from_first.clone(), first_from_camera.clone()",
        "there, back = first_from_camera.clone(), camera_from_first.clone()", OF_PROJECTIONS,
    ),
    Mutant(
        "attention's cameras stay in the frame of the world", ATTENTION,
        "first_from_camera = inverse_rigid(poses[:, :1]) @ poses", "first_from_camera = poses", OF_PROJECTIONS,
    ),
    Mutant(
        "attention's translations keep the unit of the world", ATTENTION,
        "there[..., :3, 3] /= unit\n    back[..., :3, 3] /= unit", "there[..., :3, 3] /= 1\n    back[..., :3, 3] /= 1",
        OF_PROJECTIONS,
    ),
    Mutant(
        "autocast rounds cameras to bfloat16", "semgs/runtime/precision.py",
        "first.device.type, enabled=False", "first.device.type, enabled=True", OF_PRECISION,
    ),
    Mutant(
        "shifted windows are off by one", SWIN,
        "size // 2 if shifted", "size // 2 + 1 if shifted", OF_SWIN,
    ),
    Mutant(
        "what half a window leaves at the borders stays with its neighbour", SWIN,
        "sorted({0, *range(shift, side + 1, size), side})", "sorted({0, *range(shift + size, side + 1, size), side})", OF_SWIN,
    ),
    Mutant(
        "cross-attention sees the view itself", SWIN,
        "[[j for j in range(views) if j != i] for i in range(views)]",
        "[[j for j in range(views) if j != (i + 1) % views] for i in range(views)]", OF_SWIN,
    ),
    Mutant(
        "windows of one size change places", SWIN,
        "zip(places, torch.unflatten(out, 3, sides)", "zip(reversed(places), torch.unflatten(out, 3, sides)", OF_SWIN,
    ),
    Mutant(
        "cross-attention sees what self-attention of its block has made of the other views", SWIN,
        "self.cross_attn_ffn(own, tokens, windows", "self.cross_attn_ffn(own, own, windows", OF_SWIN,
    ),
    Mutant(
        "windows are shifted in the first block, not in the second", SWIN,
        "shifted if index % 2 else plain", "plain if index % 2 else shifted", OF_SWIN,
    ),
    Mutant(
        "positions have columns before rows", SWIN,
        "torch.cat((rows.T[:, :, None].expand(-1, -1, size[1]), columns.T[:, None, :].expand(-1, size[0], -1)))",
        "torch.cat((columns.T[:, None, :].expand(-1, size[0], -1), rows.T[:, :, None].expand(-1, -1, size[1])))", OF_SWIN,
    ),
    Mutant(
        "positions have cosines before sines", SWIN,
        "% 2 == 0, angles.sin(), angles.cos()", "% 2 == 0, angles.cos(), angles.sin()", OF_SWIN,
    ),
    Mutant(
        "depth is the distance along the ray", PLACING,
        "if not conventions.z_depth:", "if conventions.z_depth:", OF_PLACEMENT,
    ),
    Mutant(
        "Gaussians lie half a pixel beside their pixel", PLACING,
        "(offsets.sigmoid() - 0.5)", "offsets.sigmoid()", OF_PLACEMENT,
    ),
    Mutant(
        "sizes do not grow with depth", PLACING,
        "rays.pixel[:, None, None] * depths", "rays.pixel[:, None, None] * torch.ones_like(depths)", OF_PLACEMENT,
    ),
    Mutant(
        "the network's quaternions are read with w first", PLACING,
        "(quaternions / length).roll(1, dims=1)", "(quaternions / length)", OF_PLACEMENT,
    ),
    Mutant(
        "axes are turned by the camera on the wrong side", PLACING,
        "quaternion_product(rays.quaternion[:, None, None], own)", "quaternion_product(own, rays.quaternion[:, None, None])",
        OF_PLACEMENT,
    ),
    Mutant(
        "harmonics stay in the frame of their camera", PLACING,
        "(harmonics * damping[:, None]).flatten(1, 2), rays.rotation,",
        "(harmonics * damping[:, None]).flatten(1, 2), torch.eye(3).to(rays.rotation).expand_as(rays.rotation),", OF_PLACEMENT,
    ),
    Mutant(
        "MVSplat's harmonics are read as ours", PLACING,
        "mvsplat_basis=not conventions.standard_harmonics", "mvsplat_basis=False", OF_PLACEMENT,
    ),
    Mutant(
        "classes are a softmax over pixels", PLACING,
        "raw[:, 7:].softmax(1)", "raw[:, 7:].softmax(2)", OF_PLACEMENT,
    ),
    Mutant(
        "a Gaussian's other cameras are camera-to-world", OVERLAP,
        "inverse_rigid(poses)[:, other] @ poses[:, own]", "inverse_rigid(poses)[:, own] @ poses[:, other]", OF_OVERLAP,
    ),
    Mutant(
        "a Gaussian's views are counted within the padded picture", PLACING,
        "Others.of(inputs.cameras, size, like)", "Others.of(inputs.cameras, inputs.cameras.size, like)", OF_OVERLAP,
    ),
    Mutant(
        "Gaussians that one view sees grow", OVERLAP,
        "PAIR / seen.clamp(min=PAIR)", "PAIR / seen", OF_OVERLAP,
    ),
    Mutant(
        "targets take the farthest input views", OVERLAP,
        "distances.argsort(stable=True)", "distances.argsort(descending=True, stable=True)", OF_NEAREST,
    ),
    Mutant(
        "Gaussians of the nearest views keep the sizes of all views", OVERLAP,
        "scales=gaussians.colour.scales * growth[:, None]", "scales=gaussians.colour.scales", OF_NEAREST,
    ),
    Mutant(
        "a Gaussian of the nearest views is not seen by its own view", OVERLAP,
        "within[:, chosen] |= _own(gaussians.means, len(chosen))", "within[:, chosen] &= ~_own(gaussians.means, len(chosen))", OF_NEAREST,
    ),
    Mutant(
        "a point is sought in the other pictures at a depth of 1", PLACING,
        "rays, self.conventions) * depths[..., None]", "rays, self.conventions)", OF_OVERLAP,
    ),
    Mutant(
        "the spread of depth is not that of its logarithm", "semgs/model/sweep/depth.py",
        "self.planes.depths[at].log()[..., None, None]", "self.planes.depths[at][..., None, None]", ("tests/model/sweep/test_depth_spread.py",),
    ),
    Mutant(
        "smaller pictures keep their camera", "semgs/geometry/cameras.py",
        "return cameras.adjusted(scale,", "return cameras.adjusted(torch.eye(3, dtype=torch.float64),", OF_NETWORK,
    ),
    Mutant(
        "pictures are padded above and left", SCENE,
        "(0, padded[1] - width, 0, padded[0] - height)", "(padded[1] - width, 0, padded[0] - height, 0)",
        ("tests/model/test_semgs.py::test_padding_repeats_the_last_row_and_the_last_column_below_and_right",),
    ),
    Mutant(
        "Gaussians come column by column", PLACING,
        "return maps[:, : kept[0], : kept[1]].flatten(1, 2)",
        "return maps[:, : kept[0], : kept[1]].transpose(1, 2).flatten(1, 2)", OF_NETWORK,
    ),
    Mutant(
        "the refinement reads disparity in 1/m", HEADS,
        "unit = near if self.conventions.relative_disparity else", "unit = torch.ones_like(near) if True else", ("tests/model/gaussians/test_near_bounds.py",),
    ),
    Mutant(
        "corrected disparity may exceed that of the near bound", HEADS,
        ".clamp(1 / far, 1 / near)", ".clamp(min=1 / far)",
        ("tests/model/gaussians/test_heads.py::test_a_correction_beyond_near_or_far_ends_there",),
    ),
    Mutant(
        "the near bound is that of the first view alone", SCENE,
        "depth_range[..., 0].amin(-1)", "depth_range[..., 0, 0]", ("tests/model/gaussians/test_near_bounds.py",),
    ),
    Mutant(
        "a scene is rendered with the near bound of its first view", "semgs/scene/encoding.py",
        "self.depth_range[..., 0].amin(-1, keepdim=True)", "self.depth_range[..., :1, 0]", ("tests/scene/test_encoding.py",),
    ),
    Mutant(
        "classes from elsewhere keep the temperatures of the network's", "semgs/scene/encoding.py",
        "classes=classes, temperatures=None)", "classes=classes)", ("tests/scene/test_with_classes.py",),
    ),
    Mutant(
        "a network begins whether memory suffices or not", "semgs/model/semgs.py",
        "return WHOLE if self.training or views.images.ndim > 4 else self.memory_plan(views).chunks", "return WHOLE", ("tests/model/weights/test_load.py",),
    ),
    Mutant(
        "depth teaches the class backbone through its cue", "semgs/model/classes/mobilenet.py",
        "cue_map.detach()", "cue_map",
        ("tests/model/sweep/test_depth_cue.py::test_depth_sees_the_cues_that_the_class_branch_gives_and_never_teaches_it",),
    ),
    Mutant(
        "the share of MOSAIC is that of the other network", "semgs/model/classes/mosaic.py",
        "(1 - self.share) * first + self.share * second", "self.share * first + (1 - self.share) * second",
        ("tests/model/classes/test_mosaic.py::test_the_mean_is_geometric",),
    ),
    Mutant(
        "classes that MOSAIC does not know lose to those that it knows", "semgs/model/classes/mosaic.py",
        "mean - total + mass", "mean - total",
        ("tests/model/classes/test_mosaic.py::test_classes_that_the_second_network_does_not_know_stay_as_likely_as_they_were",),
    ),
    Mutant(
        "a class is translated into shares of what it may come from", "semgs/model/classes/mosaic.py",
        "self.weight.softmax(0)", "self.weight.softmax(1)",
        ("tests/model/classes/test_mosaic.py::test_a_translation_divides_the_probability_of_each_known_class",),
    ),
    Mutant(
        "means at the border count what is not there", "semgs/model/classes/mosaic.py",
        "ceil_mode=True, count_include_pad=False", "ceil_mode=True, divisor_override=side * side",
        ("tests/model/classes/test_mosaic.py::test_windows_past_the_border_are_means_of_what_they_cover",),
    ),
    Mutant(
        "MOSAIC reads images as small as the MobileNet does", "semgs/model/classes/mosaic.py",
        "round(self.enlargement * side)", "round(side)",
        ("tests/model/classes/test_mosaic.py::test_images_are_enlarged_relative_to_those_of_the_mobilenet",),
    ),
    Mutant(
        "cues join depth a level too late", "semgs/model/sweep/unet.py",
        "if isinstance(block, Downsample):", "if isinstance(block, CrossViewAttention):",
        ("tests/model/sweep/test_depth_cue.py",),
    ),
    Mutant(
        "views agree by cameras of full-size images", "semgs/scene/encoding.py",
        "torch.tensor([1 / self.stride, 1 / self.stride, 1.0], dtype=torch.float64)", "torch.ones(3, dtype=torch.float64)",
        ("tests/scene/test_fused_classes.py::test_a_gaussian_takes_the_mean_of_the_log_probabilities_of_the_views_that_see_it",),
    ),
    Mutant(
        "views agree on classes in training too", "semgs/model/semgs.py",
        "if self.fuses and not self.training:", "if self.fuses:",
        ("tests/scene/test_fused_classes.py::test_the_network_fuses_outside_training_only_and_scene_by_scene",),
    ),
    Mutant(
        "the filtered cost is the correction alone", "semgs/model/sweep/cost_volume.py",
        "return cost + correction", "return correction",
        ("tests/model/sweep/test_cost_filter.py",),
    ),
    Mutant(
        "a Gaussian at an edge hangs between its surfaces", "semgs/model/sweep/upsampling.py",
        "same = self.weights * (", "same = self.weights + 0 * (", ("tests/model/sweep/test_upsampling.py",),
    ),
    Mutant(
        "the weakest weight decides on the surface", "semgs/model/sweep/upsampling.py",
        "stronger = weight > strongest", "stronger = weight < strongest", ("tests/model/sweep/test_upsampling.py",),
    ),
    Mutant(
        "rows and columns of bilinear weights are exchanged", "semgs/model/sweep/upsampling.py",
        '"yi,xj->yxij"', '"yi,xj->yxji"', ("tests/model/sweep/test_upsampling.py",),
    ),
    Mutant(
        "sharp depth is corrected by the refinement", "semgs/model/gaussians/heads.py",
        "disparities + raw[:, 0] / unit if self.convex is None else disparities", "disparities + raw[:, 0] / unit",
        ("tests/model/sweep/test_upsampling.py::test_gaussians_take_the_mode_of_the_sweep_s_depths_and_no_correction",),
    ),
    Mutant(
        "a sensor's depth is a distance where the network's is one", "semgs/scene/encoding.py",
        "(own_depths / self._z_depths(cameras))", "(own_depths / _lower_median(self.depths, stride))",
        ("tests/scene/test_with_depths.py::test_moving_all_gaussians_is_moving_each_along_its_ray",),
    ),
    Mutant(
        "moved Gaussians keep their size", "semgs/scene/encoding.py",
        "scales=shape.scales * ratios[..., None]", "scales=shape.scales",
        ("tests/scene/test_with_depths.py::test_moving_all_gaussians_is_moving_each_along_its_ray",),
    ),
    Mutant(
        "a Gaussian lies between the two surfaces of its pixels", "semgs/scene/encoding.py",
        "nanmedian(-1).values", "nanmean(-1)",
        ("tests/scene/test_with_depths.py::test_a_block_lies_on_one_of_its_surfaces_and_never_between_them",),
    ),
    Mutant(
        "the spread of depth reaches the upsampling in another unit", "semgs/model/sweep/upsampling.py",
        "spread[:, None] / LOG_UNIT", "spread[:, None] * LOG_UNIT", ("tests/model/sweep/test_upsampling.py::test_log_depths_and_their_spread_reach_the_layers_in_tenths",),
    ),
)  # fmt: skip
