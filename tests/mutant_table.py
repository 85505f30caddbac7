"""The errors that `tests/mutants.py` plants: what each replaces, and the tests that are there to notice.

Each is a mistake that someone has made or will make: a transpose, half a pixel, one camera for another. A replacement's
text must occur exactly once in its file; a test of every run (`test_mutants.py`) says so when code has moved on.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """One planted error.

    Attributes:
        name: what is wrong.
        file: where, from the root.
        before: the text that is replaced, once in its file.
        after: what stands there instead.
        tests: files of tests (or tests) that should fail, from the root.
    """

    name: str
    file: str
    before: str
    after: str
    tests: tuple[str, ...]


CAMERAS = "semgs/geometry/cameras.py"
ROTATIONS = "semgs/geometry/rotations.py"
HARMONICS = "semgs/geometry/harmonics.py"
SWEEP = "semgs/geometry/plane_sweep.py"
ATTENTION = "semgs/model/camera_attention.py"
SWIN = "semgs/model/swin.py"
COST = "semgs/model/cost_volume.py"
HEADS = "semgs/model/heads.py"
PLACING = "semgs/model/placing.py"
SCENE = "semgs/model/padded.py"
OVERLAP = "semgs/model/overlap.py"
NEAREST = "semgs/model/nearest.py"
REFERENCE = "semgs/rendering/reference.py"
RENDER = "semgs/rendering/render.py"
PINHOLE = "semgs/rendering/pinhole.py"
RULES = "semgs/rendering/rules.py"
PROJECTION = "semgs/rendering/projection_kernels.py"
GSPLAT = "semgs/rendering/gsplat_backend.py"
CORRELATION = "semgs/model/correlation_kernels.py"
LOSSES = "semgs/objectives/losses.py"
DEPTH_LOSSES = "semgs/objectives/depth_losses.py"
METRICS = "semgs/objectives/metrics.py"

OF_SFM = "tests/sfm/test_"
MERGING = "semgs/mapping/merging.py"
OF_MERGING = "tests/mapping/test_merging.py::test_"
OF_DOCTOR = "tests/doctor/test_mistakes.py::"
OF_REFINE = "tests/sfm/test_refine.py::"

FOLDERS = "semgs/files/folders.py"
CHOICE = "semgs/data/choice.py"
COVISIBILITY = "semgs/data/covisibility.py"
MAPS = "semgs/data/maps.py"
VIEW_SCORES = "semgs/reconstruction/scores.py"
SCANNET = "semgs/data/layouts/scannet/scan.py"
SCANNETPP = "semgs/data/layouts/scannetpp/devices.py"

COLMAP = "semgs/data/layouts/colmap/files.py"
POLYCAM = "semgs/data/layouts/phones/polycam.py"
RECORD3D = "semgs/data/layouts/phones/record3d.py"
ZOO = "semgs/data/layouts/zoo.py"


def of_layout(name: str, *tests: str) -> tuple[str, ...]:
    """Tests of a reader below `tests/data/layouts`, by its folder and name ("rgbd/tum")."""
    folder, _, reader = name.rpartition("/")
    return tuple(f"tests/data/layouts/{folder}/test_{reader}.py::test_{test}" for test in tests)


def of_segmenters(module: str, name: str) -> tuple[str, ...]:
    """A test of class maps and segmenters."""
    return (f"tests/segmenters/test_{module}.py::test_{name}",)


def of_scannet(name: str) -> tuple[str, ...]:
    """A test of ScanNet's reader."""
    return (f"tests/data/layouts/scannet/test_scannet.py::test_{name}",)


def of_scannetpp(name: str) -> tuple[str, ...]:
    """A test of ScanNet++'s reader."""
    return (f"tests/data/layouts/scannetpp/test_scannetpp.py::test_{name}",)


OF_CAMERAS = ("tests/geometry/test_cameras.py",)
OF_HARMONICS = ("tests/geometry/test_harmonics.py",)
OF_ATTENTION = ("tests/model/test_camera_attention.py",)
OF_SWIN = ("tests/model/test_swin.py",)
OF_SWEEP = ("tests/geometry/test_sweep_grid.py",)
OF_COST = ("tests/model/test_cost_volume.py::test_the_cost_equals_a_loop_over_pixels_and_planes",)
OF_UNSEEN = ("tests/model/test_unseen.py",)
OF_PROJECTIONS = ("tests/model/test_projections.py",)
OF_PLACEMENT = ("tests/model/test_placement.py",)
OF_OVERLAP = ("tests/model/test_overlap.py",)
OF_NEAREST = ("tests/model/test_nearest.py",)
OF_NETWORK = ("tests/model/test_semgs.py::test_each_pixel_becomes_a_gaussian_on_its_ray",)
OF_PRECISION = ("tests/model/test_precision.py",)
OF_PINHOLE = ("tests/rendering/test_pinhole.py",)
OF_ONE_GAUSSIAN = ("tests/rendering/test_reference.py::test_one_gaussian_on_the_axis_is_what_the_formula_says",)
OF_JACOBIAN = (
    "tests/rendering/test_reference.py::test_the_jacobian_sees_the_position_clamped_to_the_image_and_15_percent",
    "tests/rendering/test_reference.py::test_a_clamped_gaussian_beside_the_image_is_drawn_with_the_clamped_covariance",
)
OF_ASIDE = ("tests/rendering/test_aside.py",)
OF_CLASS_MAP = ("tests/rendering/test_render.py::test_the_class_map_sums_to_one_at_every_pixel_empty_ones_too",)
OF_GSPLAT = ("tests/rendering/test_gsplat_backend.py",)
OF_LOSSES = ("tests/objectives/test_losses.py",)
OF_DEPTH_LOSSES = ("tests/objectives/test_depth_losses.py",)
OF_METRICS = ("tests/objectives/test_metrics.py",)
OF_COLMAP = ("tests/data/layouts/colmap/test_colmap_files.py",)
OF_CHOICE = ("tests/data/test_choice.py",)
OF_COVISIBILITY = ("tests/data/test_covisibility.py",)
OF_VIEW_SCORES = ("tests/reconstruction/test_scores.py",)
OF_CAMERA_PATHS = ("tests/geometry/test_camera_paths.py",)
OF_CAMERA_FILES = ("tests/export/test_camera_files.py",)
OF_CONFIDENCE = ("tests/export/test_confidence.py",)
OF_SELECTIVE = ("tests/objectives/test_selective.py",)
OF_SPLATS = ("tests/viewer/test_splats.py",)
OF_PICKS = ("tests/viewer/test_pick.py",)
OF_VIEWER_CAMERAS = ("tests/viewer/test_viewer_views.py",)
OF_KERNELS = ("tests/rendering/test_numba_backend.py::test_numba_equals_the_reference_in_float64",)

MUTANTS = (
    # Cameras and rotations
    Mutant(
        "points are placed with the transposed rotation", CAMERAS,
        "directions = cameras.world_from_camera[..., :3, :3] @", "directions = cameras.world_from_camera[..., :3, :3].mT @",
        OF_CAMERAS,
    ),
    Mutant(
        "a point is projected with camera-to-world for world-to-camera", CAMERAS,
        "pose = cameras.camera_from_world.to(points)", "pose = cameras.world_from_camera.to(points)", OF_CAMERAS,
    ),
    Mutant(
        "the inverse of a pose forgets to turn its translation", CAMERAS,
        "= -rotation.mT @ translation", "= -translation", OF_CAMERAS,
    ),
    Mutant(
        "pixel centres lie on the corner", CAMERAS,
        "rows = torch.arange(height, dtype=dtype) + 0.5", "rows = torch.arange(height, dtype=dtype)", OF_CAMERAS,
    ),
    Mutant(
        "pixel centres have rows before columns", CAMERAS,
        "torch.meshgrid(columns, rows, indexing=\"xy\")", "torch.meshgrid(rows, columns, indexing=\"ij\")", OF_CAMERAS,
    ),
    Mutant(
        "pixels move on the wrong side of K", CAMERAS,
        "new_from_old @ self.intrinsics", "self.intrinsics @ new_from_old", ("tests/data/test_views.py",),
    ),
    Mutant(
        "a pose may be a tenth off a rotation", CAMERAS, "ROTATION_TOLERANCE = 1e-2", "ROTATION_TOLERANCE = 1e-1", OF_CAMERAS,
    ),
    Mutant(
        "quaternions are read with w last", ROTATIONS,
        "w, x, y, z = torch.nn.functional.normalize", "x, y, z, w = torch.nn.functional.normalize",
        ("tests/geometry/test_rotations.py",),
    ),
    Mutant(
        "a covariance is R^T S S^T R", ROTATIONS,
        "axes = matrix_from_quaternion(quaternions) * scales", "axes = matrix_from_quaternion(quaternions).mT * scales",
        ("tests/geometry/test_rotations.py",),
    ),
    Mutant(
        "a rotation after another is taken before it", ROTATIONS,
        "    aw, ax, ay, az = a.unbind(-1)\n    bw, bx, by, bz = b.unbind(-1)",
        "    aw, ax, ay, az = b.unbind(-1)\n    bw, bx, by, bz = a.unbind(-1)",
        ("tests/geometry/test_rotations.py",),
    ),
    Mutant(
        "a harmonic of the first degree has the other sign", HARMONICS,
        "values += [-c * y, c * z, -c * x]", "values += [c * y, c * z, -c * x]", OF_HARMONICS,
    ),
    Mutant(
        "a colour forgets its offset of one half", HARMONICS,
        "return (0.5 + torch.einsum(", "return (torch.einsum(", OF_HARMONICS,
    ),
    Mutant(
        "harmonics are turned the other way", "semgs/geometry/harmonics_rotation.py",
        "turned = directions @ rotations ", "turned = directions @ rotations.mT ",
        ("tests/geometry/test_harmonics_rotation.py",),
    ),
    # Plane sweep and cost volume
    Mutant(
        "depth candidates run from near to far", SWEEP,
        "1 / (1 / far + steps * (1 / near - 1 / far))", "1 / (1 / near + steps * (1 / far - 1 / near))", OF_SWEEP,
    ),
    Mutant(
        "the expectation of depth is linear where candidates are inverse", SWEEP,
        "return 1 / (probabilities / d).sum(-3)", "return (probabilities * d).sum(-3)", OF_SWEEP,
    ),
    Mutant(
        "the expectation of depth is inverse where candidates are linear", SWEEP,
        "return (probabilities * d).sum(-3)", "return 1 / (probabilities / d).sum(-3)", OF_SWEEP,
    ),
    Mutant(
        "the other view is projected with the reference's K", SWEEP,
        "reference.intrinsics\n    source_k = shift @ to_grid @ source.intrinsics",
        "reference.intrinsics\n    source_k = shift @ to_grid @ reference.intrinsics", OF_COST,
    ),
    Mutant(
        "feature maps are scaled by height for width", SWEEP,
        "grid[1] / width, grid[0] / height, 1.0", "grid[0] / height, grid[1] / width, 1.0", OF_SWEEP,
    ),
    Mutant(
        "texel centres are half a texel off in the sweep", SWEEP,
        "shift[0, 2] = shift[1, 2] = -0.5", "shift[0, 2] = shift[1, 2] = 0.0", OF_COST,
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
        ("tests/model/test_cost_volume.py::test_the_fused_kernel_equals_the_plain_form_in_value_and_gradient",),
    ),
    Mutant(
        "what is behind a camera counts as seen, compiled", CORRELATION,
        "inside = z > smallest[i] and -0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5\n                seen[",
        "inside = -0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5\n                seen[", OF_UNSEEN,
    ),
    # Camera-aware attention
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
        "autocast rounds cameras to bfloat16", "semgs/model/precision.py",
        "first.device.type, enabled=False", "first.device.type, enabled=True", OF_PRECISION,
    ),
    # Windows
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
    # Dual Gaussians
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
        "Others.of(scene.cameras, size, like)", "Others.of(scene.cameras, scene.cameras.size, like)", OF_OVERLAP,
    ),
    Mutant(
        "Gaussians that one view sees grow", OVERLAP,
        "PAIR / seen.clamp(min=PAIR)", "PAIR / seen", OF_OVERLAP,
    ),
    Mutant(
        "targets take the farthest input views", NEAREST,
        "distances.argsort(stable=True)", "distances.argsort(descending=True, stable=True)", OF_NEAREST,
    ),
    Mutant(
        "Gaussians of the nearest views keep the sizes of all views", NEAREST,
        "scales=gaussians.colour.scales * growth[:, None]", "scales=gaussians.colour.scales", OF_NEAREST,
    ),
    Mutant(
        "a Gaussian of the nearest views is not seen by its own view", NEAREST,
        "within[:, chosen] |= _own(gaussians.means, len(chosen))", "within[:, chosen] &= ~_own(gaussians.means, len(chosen))", OF_NEAREST,
    ),
    Mutant(
        "a point is sought in the other pictures at a depth of 1", PLACING,
        "rays, self.conventions) * depths[..., None]", "rays, self.conventions)", OF_OVERLAP,
    ),
    Mutant(
        "the spread of depth is not that of its logarithm", "semgs/model/depth.py",
        "self.planes.depths[at].log()[..., None, None]", "self.planes.depths[at][..., None, None]", ("tests/model/test_depth_spread.py",),
    ),
    Mutant(
        "smaller pictures keep their camera", SCENE,
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
        "unit = near if self.conventions.relative_disparity else", "unit = torch.ones_like(near) if True else", ("tests/model/test_near_bounds.py",),
    ),
    Mutant(
        "corrected disparity may exceed that of the near bound", HEADS,
        ".clamp(1 / far, 1 / near)", ".clamp(min=1 / far)",
        ("tests/model/test_heads.py::test_a_correction_beyond_near_or_far_ends_there",),
    ),
    Mutant(
        "the near bound is that of the first view alone", SCENE,
        "depth_range[..., 0].amin(-1)", "depth_range[..., 0, 0]", ("tests/model/test_near_bounds.py",),
    ),
    Mutant(
        "a scene is rendered with the near bound of its first view", "semgs/model/encoding.py",
        "self.depth_range[..., 0].amin(-1, keepdim=True)", "self.depth_range[..., :1, 0]", ("tests/model/test_encoding.py",),
    ),
    # Splatting
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
        "classes = layer(scene.semantic, scene.semantic.features)", "classes = layer(scene.colour, scene.semantic.features)",
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
        "with torch.autocast(place.type, enabled=False):", "with torch.autocast(place.type, enabled=torch.is_autocast_enabled(place.type)):",
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
    # Losses and metrics
    Mutant(
        "ignored pixels count as labelled", LOSSES,
        "[:, 0], labels != IGNORE", "[:, 0], labels <= IGNORE", OF_LOSSES,
    ),
    Mutant(
        "smoothness reaches across borders", LOSSES,
        "down = (labels[..., 1:, :] == labels[..., :-1, :]) & labelled[..., 1:, :]", "down = labelled[..., :-1, :] & labelled[..., 1:, :]",
        OF_LOSSES,
    ),
    Mutant(
        "smoothness looks right alone", LOSSES,
        "(probability.diff(dim=-2).abs() * down)", "(0 * probability.diff(dim=-2).abs() * down)", OF_LOSSES,
    ),
    Mutant(
        "the mean runs over the pixels of all views, not over views", LOSSES,
        "return sums / known.sum((-2, -1)).clamp(min=1)",
        "return (sums.sum() / known.sum().clamp(min=1)).expand_as(sums)", OF_LOSSES,
    ),
    Mutant(
        "cross-entropy is of log 2", LOSSES,
        "(probability.dtype).tiny).log()", "(probability.dtype).tiny).log2()", OF_LOSSES,
    ),
    Mutant(
        "a true depth goes to the wrong one of its two candidates", DEPTH_LOSSES,
        "share = (position - lower)", "share = 1 - (position - lower)", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "true depth is divided between candidates in depth, not in inverse depth", DEPTH_LOSSES,
        'if spacing == "linear"', 'if spacing != ""', OF_DEPTH_LOSSES,
    ),
    Mutant(
        "gradient matching steps into holes", DEPTH_LOSSES,
        "known[..., 1:] & known[..., :-1]", "known[..., 1:] | known[..., :-1]", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "a texel has the depth of its corner", DEPTH_LOSSES,
        "truth[..., SHRINK // 2 :: SHRINK, SHRINK // 2 :: SHRINK]", "truth[..., ::SHRINK, ::SHRINK]", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "the semantic loss weighs as much as colour", "semgs/objectives/loss_weights.py",
        "semantic: float = 0.1", "semantic: float = 1.0", OF_LOSSES,
    ),
    Mutant(
        "the union counts hits twice", METRICS,
        "confusion.sum(-1) + confusion.sum(-2) - hits)", "confusion.sum(-1) + confusion.sum(-2))", OF_METRICS,
    ),
    Mutant(
        "mean IoU counts classes that are only predicted", METRICS,
        "counted = confusion.sum(-1) > 0 if present is None", "counted = confusion.sum(-1) + confusion.sum(-2) > 0 if present is None",
        OF_METRICS,
    ),
    Mutant(
        "class accuracy is a precision", METRICS,
        "_ratio(hits, confusion.sum(-1))", "_ratio(hits, confusion.sum(-2))", OF_METRICS,
    ),
    Mutant(
        "mean IoU of images is that of their sum", "semgs/evaluation/scoring/summary.py",
        "each, shown = torch.from_numpy(confusions),", "each, shown = torch.from_numpy(0 * confusions + confusions.sum(0)),",
        ("tests/evaluation/scoring/test_summary.py",),
    ),
    Mutant(
        "validation scores the mean of scenes for that of pixels", "semgs/training/validation.py",
        "counts if confusion is None else confusion + counts", "counts", ("tests/training/test_validation.py",),
    ),
    # Training
    Mutant(
        "gradients of pieces are summed for averaged", "semgs/training/step.py",
        'terms["total"] / len(pieces)', 'terms["total"]', ("tests/training/test_processes.py",),
    ),
    Mutant(
        "processes exchange gradients after their first piece", "semgs/training/step.py",
        "enabled=piece is not pieces[-1]", "enabled=piece is not pieces[0]",
        ("tests/training/test_processes.py::test_processes_exchange_the_gradient_of_all_pieces_and_once",),
    ),
    Mutant(
        "the moving average moves on a skipped step", "semgs/training/step.py",
        "        state.average.update_parameters(state.model)", "    state.average.update_parameters(state.model)",
        ("tests/training/test_step.py::test_a_step_that_is_not_finite_leaves_the_weights_and_is_counted",),
    ),
    Mutant(
        "all processes take the same scenes", "semgs/training/execution.py",
        "step * batch + self.rank * self.accumulate * each", "step * batch", ("tests/training/test_processes.py",),
    ),
    Mutant(
        "only the processes of one machine share a step", "semgs/training/execution.py",
        "self.devices * self.nodes, self.accumulate", "self.devices, self.accumulate", ("tests/training/test_execution.py",),
    ),
    Mutant(
        "two processes train into one run folder", "semgs/training/run.py",
        "return FileLock(out / LOCK).acquire(timeout=0)", "return nullcontext()",
        ("tests/training/test_run.py::test_a_run_becomes_longer_once_somebody_trains_it_and_then_not_shorter",),
    ),
    Mutant(
        "validation uses the most input views of the training", "semgs/training/batches.py",
        "fewest = settings.contexts[0]", "fewest = settings.contexts[1]",
        ("tests/training/test_files.py::test_validation_rooms_have_the_fewest_input_views_of_the_training",),
    ),
    Mutant(
        "a mirrored camera keeps its principal point", "semgs/training/augmentation.py",
        "intrinsics[..., 0, 2] = width - intrinsics[..., 0, 2]", "pass", ("tests/training/test_augmentation.py",),
    ),
    Mutant(
        "a mirrored world keeps its poses", "semgs/training/augmentation.py",
        "poses = mirror @ views.cameras.world_from_camera @ mirror", "poses = views.cameras.world_from_camera",
        ("tests/training/test_augmentation.py",),
    ),
    Mutant(
        "a mirrored picture keeps its labels and depths", "semgs/training/augmentation.py",
        "views.map(lambda maps: maps.flip(-1), cameras=", "views.map(lambda maps: maps, lambda maps: maps.flip(-1), cameras=",
        ("tests/training/test_augmentation.py",),
    ),
    Mutant(
        "white balance changes as much as exposure", "semgs/training/augmentation.py",
        "rng.uniform(-strength, strength, 3) / 3", "rng.uniform(-strength, strength, 3)", ("tests/training/test_augmentation.py",),
    ),
    Mutant(
        "samples from folders ignore the seed", "semgs/training/samples.py",
        "SeedSequence((self._seed, k, purpose))", "SeedSequence((0, k, purpose))",
        ("tests/training/test_files.py::test_another_seed_sees_other_scenes_and_frames",),
    ),
    Mutant(
        "a rolled camera turns against its image", "semgs/training/augmentation.py",
        "views.cameras.world_from_camera @ turn,", "views.cameras.world_from_camera @ turn.mT,",
        ("tests/training/test_augmentation.py",),
    ),
    Mutant(
        "a scene may end one round and begin the next", "semgs/training/turns.py",
        "range(gap - 1 if before else 0)", "range(0)", ("tests/training/test_single_pictures.py",),
    ),
    Mutant(
        "what a teacher does not speak of counts as uncertain", "semgs/training/teacher.py",
        "(terms * known).sum((-2, -1)) / known.sum((-2, -1)).clamp(min=1)", "terms.mean((-2, -1))",
        ("tests/training/test_teacher.py",),
    ),
    Mutant(
        "vignetting takes double from the corners", "semgs/training/photo.py",
        "np.float32(loss / 2)", "np.float32(loss)", ("tests/training/test_photo.py",),
    ),
    Mutant(
        "classes are brought to another table by position", "semgs/training/samples.py",
        "table.names.index(name) if name in table.names else IGNORE", "views.classes.names.index(name)",
        ("tests/training/test_files.py",),
    ),
    Mutant(
        "the moving average forgets as its weights should stay", "semgs/training/state.py",
        "torch._foreach_lerp_(averages, weights, 1 - now)", "torch._foreach_lerp_(averages, weights, now)",
        ("tests/training/test_step.py",),
    ),
    Mutant(
        "a resumed run has Adam begin anew", "semgs/training/state.py",
        '{"state": held, "param_groups"', '{"state": {}, "param_groups"', ("tests/training/test_loop.py",),
    ),
    Mutant(
        "a resumed run forgets its best score", "semgs/training/state.py",
        'float(numbers.get("best_score", -math.inf))', "-math.inf",
        ("tests/training/test_loop.py::test_a_run_that_goes_on_knows_the_best_score_of_before",),
    ),
    Mutant(
        "PSNR is of the square of the error", METRICS,
        "return -10 * (images.clamp(0, 1) - truth)", "return -20 * (images.clamp(0, 1) - truth)", OF_METRICS,
    ),
    Mutant(
        "GSNeRF's distance takes R for its transpose", "semgs/evaluation/frames/protocols.py",
        '-np.einsum("nji,nj->ni"', '-np.einsum("nij,nj->ni"', ("tests/evaluation/frames/test_protocols.py",),
    ),
    # Kernels in threads, the time they take to compile, and the page of a reconstruction
    Mutant(
        "one part of a kernel's work is left out", "semgs/geometry/compiled.py",
        "for part in range(parts)]", "for part in range(parts - 1)]", ("tests/geometry/test_compiled.py",),
    ),
    Mutant(
        "compiling counts as the stage in which it happens", "semgs/reconstruction/stages.py",
        "perf_counter() - start - compiled()", "perf_counter() - start", ("tests/reconstruction/test_stages.py",),
    ),
    Mutant(
        "what a kernel calls is compiled twice, by the clock", "semgs/geometry/compiling.py",
        "            if self.depth == 0:\n                self.seconds +=", "            if True:\n                self.seconds +=",
        ("tests/reconstruction/test_stages.py",),
    ),
    Mutant(
        "a class of one percent counts as rare", "semgs/figures/page.py",
        "if entry.share < RARE)", "if entry.share <= RARE)", ("tests/figures/test_page.py",),
    ),
    Mutant(
        "a percentage is a share", "semgs/figures/numbers.py",
        'f"{100 * share:.0f} %"', 'f"{share:.0f} %"', ("tests/figures/test_numbers.py",),
    ),
    # Files that carry Gaussians
    # Camera paths and files, images
    Mutant(
        "an orbit leaves the directions of the camera as they are", "semgs/geometry/camera_paths.py",
        "poses[:, :3, :3] = turns @ start[:3, :3]", "poses[:, :3, :3] = start[:3, :3]", OF_CAMERA_PATHS,
    ),
    Mutant(
        "an orbit is around the origin", "semgs/geometry/camera_paths.py",
        "pivot + turns @ (start[:3, 3] - pivot)", "turns @ start[:3, 3]", OF_CAMERA_PATHS,
    ),
    Mutant(
        "a swing goes by its whole angle to either side", "semgs/geometry/camera_paths.py",
        "radians(degrees) / 2 * np.sin", "radians(degrees) * np.sin", OF_CAMERA_PATHS,
    ),
    Mutant(
        "the middle of a wider view stays where it was", "semgs/geometry/camera_paths.py",
        "[[scale, 0, (size[1] - scale * cameras.size[1]) / 2]", "[[scale, 0, 0]", OF_CAMERA_PATHS,
    ),
    Mutant(
        "the field of view of a camera path is horizontal", "semgs/export/camera_files.py",
        "focal_px = height / 2 /", "focal_px = width / 2 /", OF_CAMERA_FILES,
    ),
    Mutant(
        "cameras of files have OpenCV axes", "semgs/export/camera_files.py",
        "pose.reshape(4, 4) @ OPENCV_FROM_OPENGL", "pose.reshape(4, 4)", OF_CAMERA_FILES,
    ),
    Mutant(
        "colour with transparency is darkened twice", "semgs/export/stills.py",
        "rendering.images[0] / rendering.alphas[0].clamp(min=LEAST_ALPHA)", "rendering.images[0]", ("tests/export/test_stills.py",),
    ),
    # Confidence
    Mutant(
        "a Gaussian takes the temperature of pixels", "semgs/export/confidence.py",
        "scene.temperatures.gaussians", "scene.temperatures.rendered", OF_CONFIDENCE,
    ),
    Mutant(
        "a pixel takes the temperature of Gaussians", "semgs/export/scene.py",
        "self.temperatures.rendered", "self.temperatures.gaussians", OF_CONFIDENCE,
    ),
    Mutant(
        "a temperature multiplies", "semgs/rendering/temperatures.py",
        "(logarithms(distributions) / temperature)", "(logarithms(distributions) * temperature)", OF_CONFIDENCE,
    ),
    Mutant(
        "classes from elsewhere keep the temperatures of the network's", "semgs/model/encoding.py",
        "classes=classes, temperatures=None)", "classes=classes)", ("tests/model/test_with_classes.py",),
    ),
    Mutant(
        "unseen pixels may be unknown", "semgs/rendering/rendering.py",
        "    labels[_unseen(rendering)] = UNSEEN\n", "    labels[_unseen(rendering) & (labels != UNKNOWN)] = UNSEEN\n",
        ("tests/figures/test_classes_picture.py",),
    ),
    Mutant(
        "the spread of rendered depth forgets that depths are apart", "semgs/rendering/depth_spread.py",
        "torch.stack((log, log.square() + depth_spread.square()), 1)", "torch.stack((0 * log, depth_spread.square()), 1)",
        ("tests/rendering/test_rendered_depth_spread.py::test_a_pixel_of_two_depths_has_the_spread_of_both_and_that_between_them",),
    ),
    Mutant(
        "percent of confidence are rounded to the nearest", "semgs/reconstruction/renders.py",
        "np.floor(100 *", "np.rint(100 *", ("tests/reconstruction/test_renders.py",),
    ),
    Mutant(
        "a risk-coverage curve begins with the least confident", "semgs/objectives/selective.py",
        "pixels = counts[..., ::-1, 0]", "pixels = counts[..., 0]", OF_SELECTIVE,
    ),
    Mutant(
        "the area under a risk-coverage curve forgets earlier errors", "semgs/objectives/selective.py",
        "(missed - wrong - rate * before) * growth", "(0 - rate * before) * growth", OF_SELECTIVE,
    ),
    Mutant(
        "errors of calibration cancel within all bins", "semgs/objectives/selective.py",
        "np.abs(sums).sum(-1)", "np.abs(sums.sum(-1))", OF_SELECTIVE,
    ),
    Mutant(
        "unseen pixels count for the calibration", "semgs/evaluation/scoring/frame_scores.py",
        "(labels != IGNORE) & (prediction.confidences > 0)", "labels != IGNORE",
        ("tests/evaluation/scoring/test_frame_scores.py::test_only_labelled_and_seen_pixels_count_for_the_confidence",),
    ),
    Mutant(
        "a PLY holds scales for their logarithm", "semgs/export/ply.py",
        "scales.clamp(min=_SMALLEST_SCALE).log()", "scales.clamp(min=_SMALLEST_SCALE)", ("tests/export/test_ply.py",),
    ),
    Mutant(
        "a PLY holds its harmonics coefficient by coefficient", "semgs/export/ply.py",
        "full[:, 1:].mT.flatten(1)", "full[:, 1:].flatten(1)", ("tests/export/test_ply.py",),
    ),
    Mutant(
        "glTF has quaternions with w first", "semgs/export/gltf.py",
        "quaternions.roll(-1, dims=-1)", "quaternions", ("tests/export/test_gltf.py",),
    ),
    Mutant(
        "glTF has the logarithm of scales", "semgs/export/gltf.py",
        "gaussians.colour.scales,", "gaussians.colour.scales.log(),", ("tests/export/test_gltf.py",),
    ),
    Mutant(
        "glTF counts harmonics over all degrees", "semgs/export/gltf.py",
        "{index - degree**2}", "{index}", ("tests/export/test_gltf.py",),
    ),
    Mutant(
        "the fallback colour of glTF lacks the factor of the constant harmonic", "semgs/export/gltf.py",
        "0.5 + DEGREE_0 * harmonics[:, 0]", "0.5 + harmonics[:, 0]", ("tests/export/test_gltf.py",),
    ),
    # Readers of data sets
    Mutant(
        "the centre of ScanNet's first pixel stays at 0", SCANNET,
        "(cx + HALF, cy + HALF)", "(cx, cy)",
        of_scannet("a_point_is_where_scannets_own_formula_puts_it"),
    ),
    Mutant(
        "ScanNet's depth is taken to be the colour camera's", MAPS,
        "carried_over(self.map.metres(), self.lens, self.of_picture or pixels.lens)",
        "fitted(self.map.path, self.map.metres(), pixels.lens.size)",
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
        "of rows that share an id the first counts", "semgs/data/layouts/scannet/labels.py",
        "by_id[identity] = _whole(", "by_id[identity] = by_id.get(identity) or _whole(",
        ("tests/data/test_nyu40.py::test_of_rows_that_share_an_id_the_last_counts",),
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
        "a fisheye is handed to OpenCV with COLMAP's principal point", "semgs/data/fisheye.py",
        "(self.centre[0] - self._half, self.centre[1] - self._half)", "self.centre", of_scannetpp("a_fisheye_is_undone_to_a_tenth_of_a_pixel"),
    ),
    Mutant(
        "of objects that share a vertex the largest counts", "semgs/data/layouts/scannetpp/mesh.py",
        "groups.append((-int(sizes", "groups.append((int(sizes",
        of_scannetpp("of_objects_that_share_a_vertex_the_smallest_counts_even_if_it_has_no_label"),
    ),
    Mutant(
        "rays are cast through the corners of pixels", "semgs/data/layouts/scannetpp/mesh.py",
        "np.stack((column + 0.5, row + 0.5,", "np.stack((column, row,", of_scannetpp("the_phones_frames_are_read_as_they_were_written"),
    ),
    Mutant(
        "what a mask hides keeps its depth", "semgs/data/frames.py",
        "depths.masked_fill(hidden, 0)", "depths",
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
        "association takes the first in time, not the nearest", "semgs/data/layouts/parts/association.py",
        "(abs(first[i] - second[j]), i, int(j))", "(second[j], i, int(j))",
        of_layout("rgbd/tum", "association_takes_the_nearest_first_and_each_once"),
    ),
    Mutant(
        "the principal point of Replica counts from the centre of the first pixel", "semgs/data/layouts/replica/sequence.py",
        "(width / 2, row * height)", "((width - 1) / 2, row * height)", of_layout("replica/replica", "a_point_is_where_the_renderer_puts_it"),
    ),
    Mutant(
        "files are sorted by name, 10 before 2", "semgs/data/layouts/parts/recordings.py",
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
        "depths[counts == SATURATED] = 0", "pass", of_layout("rgbd/frame_files", "what_is_read_equals_what_was_written"),
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
        "p.reshape(3, 4)[:, :3] if rectified else k.reshape(3, 3)", "p.reshape(3, 4)[:, :3]",
        of_layout("ros/ros_bag", "a_point_is_where_opencvs_formula_puts_it"),
    ),
    Mutant(
        "a region of interest leaves the principal point where it was", "semgs/data/layouts/ros/camera.py",
        "(matrix[0, 2] + HALF - x) / bins[0]", "(matrix[0, 2] + HALF) / bins[0]",
        of_layout("ros/ros_bag", "binning_and_regions_of_interest_move_the_camera"),
    ),
    Mutant(
        "red and blue change places in a bag", "semgs/data/layouts/ros/images.py",
        '"rgb8": (3, cv2.COLOR_RGB2BGR), "bgr8": (3, None)', '"rgb8": (3, None), "bgr8": (3, None)',
        of_layout("ros/ros_bag", "pixels_of_all_encodings_are_what_they_say"),
    ),
    Mutant(
        "Polycam's axes are taken as OpenCV's", POLYCAM,
        "* (1, -1, -1, 1)", "* (1, 1, 1, 1)", of_layout("phones/polycam", "a_point_is_where_arkits_axes_and_pixels_put_it"),
    ),
    Mutant(
        "half a pixel is added to Polycam's principal point", POLYCAM,
        "(cx, cy), (height, width)", "(cx + 0.5, cy + 0.5), (height, width)",
        of_layout("phones/polycam", "a_point_is_where_arkits_axes_and_pixels_put_it"),
    ),
    Mutant(
        "depth belongs to Polycam's corrected images", POLYCAM,
        "raw.get(time) if optimised else None", "None",
        of_layout("phones/polycam", "corrected_images_have_the_depth_of_the_uncorrected_camera_along_their_rays"),
    ),
    Mutant(
        "a high blur score means blur", POLYCAM,
        '"blur_score", SHARP) >= SHARP', '"blur_score", SHARP) <= SHARP',
        of_layout("phones/polycam", "blurred_frames_and_missing_files_are_left_out_and_counted"),
    ),
    Mutant(
        "half a pixel is added to cx only in what scenezoo reads", ZOO,
        "    cy = cy + source.half\n", "",
        ("tests/data/layouts/test_zoo.py::test_half_a_pixel_is_added_where_the_first_centre_is_0",),
    ),
    Mutant(
        "rows of Matterport3D count from the top", ZOO,
        "height - cy if source.from_below", "cy if source.from_below",
        ("tests/data/layouts/test_zoo.py::test_rows_that_count_from_below_are_turned_round",),
    ),
    Mutant(
        "scenezoo's poses are taken as camera to world", ZOO,
        "np.linalg.inv(np.asarray(matrix, np.float64))", "np.asarray(matrix, np.float64)",
        ("tests/data/layouts/test_zoo.py::test_half_a_pixel_is_added_where_the_first_centre_is_0",),
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
        "size, sure = (height, width),", "size, sure = (width, height),",
        of_layout("phones/record3d", "what_is_read_equals_what_was_written"),
    ),
    Mutant(
        "depth of low confidence counts", MAPS,
        "depths[self._confidences(self.confidence, depths.shape) == 0] = 0", "pass",
        of_layout("phones/polycam", "depth_of_low_confidence_is_unknown"),
    ),
    Mutant(
        "prepared poses keep OpenCV's axes", "semgs/preparation/archive.py",
        "pose[:3, 1:3] *= -1", "pose[:3, 1:3] *= 1",
        ("tests/preparation/test_preparation.py::test_a_prepared_scene_is_the_scene_resized_with_its_camera",),
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
        "zip members are inflated whole, whatever size they list", "semgs/files/archives.py",
        ".decompress(data, self.size + 1)", ".decompress(data)", ("tests/files/test_archives.py",),
    ),
    Mutant(
        "counts of a PGM have their low byte first", "semgs/files/pictures.py",
        'np.frombuffer(data, ">u2"', 'np.frombuffer(data, "<u2"',
        ("tests/files/test_pictures.py::test_counts_of_a_pgm_are_taken_as_they_are",),
    ),
    # Scenes far from their origin
    Mutant(
        "a far scene is moved twice as far as its origin", "semgs/data/scene.py",
        "views.cameras.relative_to(self.origin)", "views.cameras.relative_to(2 * self.origin)",
        ("tests/reconstruction/test_reconstruct.py",),
    ),
    Mutant(
        "an origin is added for subtracted", CAMERAS, "poses[..., :3, 3] -= as_float64(origin)", "poses[..., :3, 3] += as_float64(origin)",
        ("tests/export/test_scene.py", "tests/reconstruction/test_reconstruct.py"),
    ),
    Mutant(
        "a scene file's cameras stay about the origin", "semgs/export/scene.py",
        "in_source.relative_to([-side for side in scene.origin])", "in_source", ("tests/export/test_scene.py",),
    ),
    # Damage
    Mutant(
        "damaged checkpoints count among the last three", "semgs/training/checkpoints.py",
        "(record == own or _intact(record) is not None)", "True", ("tests/training/test_damage.py",),
    ),
    Mutant(
        "a run whose checkpoints are all damaged begins anew", "semgs/training/checkpoints.py",
        "    if damaged:\n", "    if False:\n", ("tests/training/test_damage.py",),
    ),
    Mutant(
        "of a key that appears twice the last counts", "semgs/files/strict_json.py",
        "if len(content) < len(pairs):", "if False:", ("tests/files/test_strict_json.py",),
    ),
    Mutant(
        "tensors of weights are not compared with their checksum", "semgs/weights/file.py",
        "!= found:", "is None:", ("tests/weights/test_crafted.py",),
    ),
    # Choice of views
    Mutant(
        "views twice as far apart are preferred", CHOICE,
        "IDEAL_BASELINE = (0.05, 0.15)", "IDEAL_BASELINE = (0.1, 0.3)", OF_CHOICE,
    ),
    Mutant(
        "the preference for a baseline falls off half as fast", CHOICE, "STEEPNESS = 0.72", "STEEPNESS = 1.44", OF_CHOICE,
    ),
    # What Python callers meet
    Mutant(
        "scenes are read at the size of their pictures unless somebody asks", "semgs/data/scene.py",
        "return default_size(first.lens.size)", "return None", ("tests/data/test_scenes.py",),
    ),
    Mutant(
        "rendered images are brighter than 1", "semgs/rendering/render.py",
        "images = images.clamp(0, 1)", "images = images.clamp(min=0)",
        ("tests/rendering/test_render.py::test_images_lie_in_0_to_1_unless_a_loss_asks_for_them_as_they_are",),
    ),
    Mutant(
        "losses compare clamped images", "semgs/training/objective.py",
        "encoding.render(target.cameras, clamp=False)", "encoding.render(target.cameras)",
        ("tests/training/test_supervision.py::test_a_pixel_that_is_too_bright_is_compared_as_bright_as_it_is",),
    ),
    Mutant(
        "a network begins whether memory suffices or not", "semgs/model/semgs.py",
        "return memory_plan(self, views).chunks", "return WHOLE", ("tests/weights/test_load.py",),
    ),
    Mutant(
        "a loaded network has gradients", "semgs/weights/load.py",
        "model.eval().requires_grad_(False)", "model.eval()", ("tests/weights/test_load.py",),
    ),
    Mutant(
        "a run that was made longer is made shorter again", "semgs/training/run.py",
        "if settings.steps > there.steps:", "if settings.steps != there.steps:", ("tests/training/test_run.py",),
    ),
    Mutant(
        "the colours of a class map are one class off", "semgs/files/colours.py",
        "palette[: len(colours)] = colours", "palette[1 : len(colours) + 1] = colours", ("tests/test_in_a_notebook.py",),
    ),
    Mutant(
        "views that share nothing may go in together", CHOICE, "LEAST_SHARED = 0.3", "LEAST_SHARED = 0.0", OF_CHOICE,
    ),
    Mutant(
        "a held-out view may look elsewhere", CHOICE, "WELL_SEEN = 0.9", "WELL_SEEN = 0.5", OF_CHOICE,
    ),
    Mutant(
        "baselines are judged at the middle of near and far though depth is known", CHOICE,
        "preference(baselines / depths)", "preference(baselines / typical)", OF_CHOICE,
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
        "classes over the seen pixels are over all", "semgs/objectives/map_scores.py",
        "truth.labels.masked_fill(~seen, IGNORE)", "truth.labels", OF_VIEW_SCORES,
    ),
    Mutant(
        "errors of depth are averaged over views, not pixels", VIEW_SCORES,
        "getattr(view, weights[name]) if name in weights else 1)", "1)", OF_VIEW_SCORES,
    ),
    # What the system does meanwhile
    Mutant(
        "an old folder loses its name before the new one has it", FOLDERS,
        "if _exchange(staging, target):", "if False:",
        ("tests/files/test_folders.py::test_a_kill_right_after_the_first_rename_leaves_a_whole_folder_under_the_name",),
    ),
    Mutant(
        "two processes may have one folder", FOLDERS,
        "fcntl.LOCK_EX", "fcntl.LOCK_SH",
        ("tests/files/test_folders.py::test_one_process_at_a_time_has_a_folder",),
    ),
    Mutant(
        "a mount point is found after the work", FOLDERS,
        "if target.is_mount():", "if False:",
        ("tests/files/test_folders.py::test_a_mount_point_is_told_before_the_work",),
    ),
    Mutant(
        "a request to end counts as wrong arguments", "semgs/cli/arguments.py",
        "if leaving.code != REFUSED:", "if leaving.code in (None, 0):",
        ("tests/cli/test_refused_by_the_system.py::test_a_request_to_end_while_arguments_are_parsed_is_none_of_the_arguments",),
    ),
    Mutant(
        "names reach the terminal as they are", "semgs/cli/main.py",
        "redirect_stdout(Plain(sys.stdout))", "redirect_stdout(sys.stdout)",
        ("tests/cli/test_refused_by_the_system.py::test_a_hostile_name_of_a_folder_is_prepared_into_and_shown_but_not_trained_into",),
    ),
    Mutant(
        "weights that may not be read count as somebody else's", "semgs/weights/file.py",
        'Path(path).open("rb").close()', "pass",
        ("tests/cli/test_refused_by_the_system.py::test_what_may_not_be_read_is_named",),
    ),
    Mutant(
        "depth teaches the class backbone through its cue", "semgs/model/mobilenet.py",
        "one.detach()", "one",
        ("tests/model/test_depth_cue.py::test_depth_sees_the_cues_that_the_class_branch_gives_and_never_teaches_it",),
    ),
    Mutant(
        "cues join depth a level too late", "semgs/model/unet.py",
        "if isinstance(block, Downsample):", "if isinstance(block, CrossViewAttention):",
        ("tests/model/test_depth_cue.py",),
    ),
    Mutant(
        "the filtered cost is the correction alone", "semgs/model/cost_filter.py",
        "return cost + correction", "return correction",
        ("tests/model/test_cost_filter.py",),
    ),
    Mutant(
        "a rate of zero still learns", "semgs/training/state.py",
        "if shares.get(name, 1.0) > 0}", "}",
        ("tests/training/test_supervision.py::test_a_rate_of_zero_freezes_what_it_is_for_and_nothing_else",),
    ),
    Mutant(
        "a folder whose record has more settings is gone on with", "semgs/files/claims.py",
        "set(there) != set(settings)", "set(there) < set(settings)",
        ("tests/files/test_claims.py::test_a_record_of_something_else_is_refused",),
    ),
    Mutant(
        "shaded rooms are added to traced ones", "semgs/rooms/sets/scenes.py",
        'SHADED = "shaded"', 'SHADED = "traced"',
        ("tests/rooms/sets/test_dataset.py::test_shaded_rooms_of_a_release_that_also_traced_go_on_and_traced_ones_do_not",),
    ),
    Mutant(
        "cameras of the held-out world are used as those in homes", "semgs/rooms/sets/cameras.py",
        'if style != "home":', 'if style == "nowhere":',
        ("tests/rooms/sets/test_cameras_of_rooms.py::test_the_held_out_world_has_the_usual_cameras_and_no_number_is_spent_on_it",),
    ),
    Mutant(
        "close cameras are anywhere in the room", "semgs/rooms/sets/cameras.py",
        "150, subject)[:60]", "150)[:60]",
        ("tests/rooms/sets/test_cameras_of_rooms.py::test_close_cameras_are_within_90_cm_of_their_subject_and_fill_the_frame_with_it",),
    ),
    Mutant(
        "a sofa in the room has its front to it", "semgs/rooms/plans/home.py",
        "*wall.at(left + width, off + depth), wall.yaw + np.pi,", "*wall.at(left, off), wall.yaw,",
        ("tests/rooms/plans/test_homes.py::test_a_sofa_in_the_room_has_its_back_a_metre_or_more_from_the_wall_behind_it",),
    ),
    Mutant(
        "glazed cabinets hang in windows", "semgs/rooms/plans/home.py",
        " or not wall.free(start, end, low, high)", "",
        ("tests/rooms/plans/test_homes.py::test_no_glazed_cabinet_hangs_in_a_window",),
    ),
    Mutant(
        "a washstand's bowl is full of cabinet", "semgs/rooms/pieces/kitchen_and_bath.py",
        "(width - 0.01, depth - 0.04, height - 0.19)", "(width - 0.01, depth - 0.04, height - 0.05)",
        ("tests/rooms/pieces/test_kitchen_and_bath.py::test_a_washstand_is_a_sink_in_a_counter_on_a_cabinet",),
    ),
    Mutant(
        "a run in a world that is given up continues in homes", "semgs/training/settings.py",
        '(style := saved.pop("style", "home")) != "home"', '(style := saved.pop("style", "home")) == "other"',
        ("tests/training/test_whole_runs.py::test_worlds_that_no_training_may_see_are_refused",),
    ),
    Mutant(
        "maps of distorted photos are taken for undistorted ones", "semgs/segmenters/maps.py",
        "None if undistorted or frame.lens.is_pinhole else frame.lens.maps()", "None",
        of_segmenters("segmenter_maps", "a_map_that_tells_position_lands_where_the_photo_does"),
    ),
    Mutant(
        "maps are cropped from the corner", "semgs/segmenters/maps.py",
        "[left : left + width]\n    return", "[:width]\n    return",
        of_segmenters("segmenter_maps", "a_crop_takes_the_middle_and_halves_are_normalised"),
    ),
    Mutant(
        "a pixel without a label is sure of the first class", "semgs/segmenters/maps.py",
        "1 / classes, found)", "0.0, found)",
        of_segmenters("segmenter_maps", "a_pixel_without_label_is_even"),
    ),
    Mutant(
        "a segmenter votes against what it does not know", "semgs/segmenters/labelling.py",
        "torch.where(known[:, None, None], said, neutral)", "said",
        of_segmenters("labelling", "a_class_that_the_segmenter_cannot_say_gets_a_neutral_vote"),
    ),
    Mutant(
        "views vote that see something nearer", "semgs/segmenters/fusion.py",
        "agrees = inside & (", "agrees = inside | (",
        of_segmenters("fusion", "fusion_equals_a_loop_over_points_and_views"),
    ),
    Mutant(
        "common classes take what a segmenter says", "semgs/segmenters/fitting.py",
        "frequency**PRIOR_POWER", "frequency**0",
        of_segmenters("fitting", "the_class_frequency_is_divided_out_by_its_root"),
    ),
    Mutant(
        "an exported network's mean is of pixels up to 1", "semgs/segmenters/exported.py",
        "return (255 * offset, 255 * scale)", "return (offset, 255 * scale)",
        ("tests/segmenters/test_exported.py::test_logits_become_probabilities_by_softmax",),
    ),
    Mutant(
        "logits are normalised without an exponential", "semgs/segmenters/exported.py",
        "return values.softmax(0).numpy()", "return normalised(values).numpy()",
        ("tests/segmenters/test_exported.py::test_logits_become_probabilities_by_softmax",),
    ),
    Mutant(
        "an exported network's photo is sampled where it shrinks", "semgs/segmenters/exported.py",
        "interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR", "interpolation=cv2.INTER_NEAREST",
        ("tests/segmenters/test_exported.py::test_a_larger_photo_is_averaged_by_area",),
    ),
    Mutant(
        "the zero point of quantised logits is ignored", "semgs/segmenters/litert.py",
        "(found.astype(np.float32) - self._zero) *", "found.astype(np.float32) *",
        ("tests/segmenters/test_exported.py::test_quantised_logits_are_converted_with_the_scale_and_zero_point_of_the_file",),
    ),
    Mutant(
        "scores of masks go through a softmax", "semgs/segmenters/huggingface.py",
        "(_shares(scores) if self.masks else scores.softmax(0))", "scores.softmax(0)",
        ("tests/segmenters/test_huggingface.py::test_models_with_masks_give_the_sum_over_masks_divided_by_that_over_classes",),
    ),
    Mutant(
        "none of these has a logit of 1", "semgs/segmenters/words.py",
        "torch.zeros_like(found[:1])", "torch.ones_like(found[:1])",
        ("tests/segmenters/test_huggingface.py::test_other_text_prompted_models_can_be_used",),
    ),
    Mutant(
        "maps of other words are taken again", "semgs/segmenters/opening.py",
        "(stored.made_by, stored.classes.names) != (made_by, self.segmenter.classes.names)", "stored.made_by != made_by",
        ("tests/segmenters/test_cost.py::test_maps_of_another_network_or_of_other_classes_are_made_anew",),
    ),
    Mutant(
        "maps of another scene's photos are taken again", "semgs/segmenters/images.py",
        "self.earlier.photos.get(frame.name) != sha256_of(image)", "frame.name not in self.earlier.photos",
        ("tests/segmenters/test_cost.py::test_maps_of_other_photos_with_the_same_names_are_made_anew",),
    ),
    Mutant(
        "a sensor's depth is a distance where the network's is one", "semgs/model/encoding.py",
        "(placed / self._z_depths(cameras))", "(placed / _lower_median(self.depths, stride))",
        ("tests/model/test_with_depths.py::test_moving_all_gaussians_is_moving_each_along_its_ray",),
    ),
    Mutant(
        "moved Gaussians keep their size", "semgs/model/encoding.py",
        "scales=shape.scales * ratios[..., None]", "scales=shape.scales",
        ("tests/model/test_with_depths.py::test_moving_all_gaussians_is_moving_each_along_its_ray",),
    ),
    Mutant(
        "a Gaussian lies between the two surfaces of its pixels", "semgs/model/encoding.py",
        "nanmedian(-1).values", "nanmean(-1)",
        ("tests/model/test_with_depths.py::test_a_block_lies_on_one_of_its_surfaces_and_never_between_them",),
    ),
    Mutant(
        "depth is fitted instead of its inverse", "semgs/reconstruction/depth_fit.py",
        "(1 / depths[known].double() for", "(depths[known].double() for",
        ("tests/reconstruction/test_depth_fit.py::test_scale_and_shift_come_back",),
    ),
    Mutant(
        "outliers vote in the fit", "semgs/reconstruction/depth_fit.py",
        ".clamp(min=0).square()", ".clamp(min=0).square() * 0 + 1",
        ("tests/reconstruction/test_depth_fit.py::test_forty_percent_of_outliers_have_no_vote",),
    ),
    Mutant(
        "the more a sensor is off, the more it counts", "semgs/reconstruction/sensor.py",
        "weights * variance / (variance + noise)", "weights * noise / (variance + noise)",
        ("tests/reconstruction/test_sensor.py::test_both_weighs_log_depths_by_their_inverse_variances",),
    ),
    Mutant(
        "depth maps that lie to the right are found to the left", "semgs/reconstruction/registration.py",
        "margin - right :", "margin + right :",
        ("tests/reconstruction/test_registration.py::test_shifted_depth_is_found_to_within_half_a_window",),
    ),
    Mutant(
        "rendered features are not divided by the weights", "semgs/rendering/features.py",
        "torch.cat(pictures) / alphas.clamp(min=LEAST_ALPHA)", "torch.cat(pictures)",
        ("tests/rendering/test_feature_rendering.py::test_the_front_counts_by_its_alpha_and_the_back_by_what_is_left",),
    ),
    Mutant(
        "features are splatted with the shapes of colour", "semgs/rendering/features.py",
        "shape = scene.semantic or scene.colour", "shape = scene.colour",
        ("tests/rendering/test_feature_rendering.py::test_features_equal_the_reference_pass_for_pass",),
    ),
    Mutant(
        "a feature of zeros takes an entry of the book", "semgs/segmenters/compression.py",
        "torch.where(length[:, 0] < SHORTEST, 0, nearest)", "nearest",
        ("tests/segmenters/test_compression.py::test_zero_stays_zero_and_a_book_goes_by_direction",),
    ),
    Mutant(
        "the energy that is kept is not about the mean", "semgs/segmenters/features.py",
        "energy = self._count - float(self._sum.square().sum()) / max(1, self._count)", "energy = float(self._count)",
        ("tests/segmenters/test_features.py::test_what_is_kept_and_the_bound_are_worked_out_by_hand",),
    ),
    Mutant(
        "a segmenter's labels are undistorted twice", "semgs/segmenters/relabelling.py",
        "replace(pixels, maps=None).taken", "pixels.taken",
        ("tests/segmenters/test_relabelling.py::test_labels_land_on_the_pixels_that_the_segmenter_saw_through_lens_and_crop",),
    ),
    Mutant(
        "a tie between classes is a label", "semgs/segmenters/relabelling.py",
        "(best >= confidence) & clear", "best >= confidence",
        ("tests/segmenters/test_relabelling.py::test_a_pixel_has_a_label_if_one_class_is_likely_enough_and_alone",),
    ),
    Mutant(
        "weights do not say who taught them", "semgs/data/terms.py",
        "    if labeller is None:\n        return own\n", "    return own\n",
        ("tests/segmenters/test_relabelling.py::test_a_student_has_the_terms_of_its_teacher_and_rooms_stay_rooms",),
    ),
    Mutant(
        "exports: lines of the detector are half a pixel off", "semgs/export/own_views.py",
        "reshape(-1, 2, 2) + OFFSET_PX)", "reshape(-1, 2, 2))", ("tests/export/test_upright.py",),
    ),
    Mutant(
        "exports: normals of lines stay in the camera's frame", "semgs/export/own_views.py",
        "normals @ scene.cameras.world_from_camera[view, :3, :3].T", "normals", ("tests/export/test_upright.py",),
    ),
    Mutant(
        "exports: every point has the colour that the first view sees", "semgs/export/own_views.py",
        "scene.cameras.centres[scene.own_views]", "scene.cameras.centres[:1]",
        ("tests/export/test_points.py",),
    ),
    Mutant(
        "exports: the matrix back forgets the scene's origin", "semgs/export/upright.py",
        "return FramedScene(moved, turned @ _to_origin(scene), axes)", "return FramedScene(moved, turned, axes)",
        ("tests/export/test_upright.py",),
    ),
    Mutant(
        "exports: export.json has the inverse matrix", "semgs/export/record.py",
        "file.framed.source_from_file", "file.framed.file_from_source", ("tests/cli/test_export_command.py",),
    ),
    Mutant(
        "exports: COLMAP gets camera-to-world poses", "semgs/export/colmap.py",
        "poses = scene.cameras.camera_from_world", "poses = scene.cameras.world_from_camera",
        ("tests/export/test_colmap_model.py",),
    ),
    Mutant(
        "exports: sightings count from one", "semgs/export/colmap.py",
        "tracks.seen.cumsum(1) - 1", "tracks.seen.cumsum(1)", ("tests/export/test_colmap_model.py",),
    ),
    Mutant(
        "exports: blue and red change places in a bag", "semgs/export/points.py",
        "red << 16 | green << 8 | blue", "blue << 16 | green << 8 | red", ("tests/export/test_points.py",),
    ),
    # The viewer
    Mutant(
        "splats are not scaled with the world", "semgs/viewer/splats.py",
        "found: Tensor = covariance(shape.quaternions, scale * shape.scales)", "found: Tensor = covariance(shape.quaternions, shape.scales)", OF_SPLATS,
    ),
    Mutant(
        "colours are seen from the first input view", "semgs/viewer/splats.py",
        "scene.cameras.centres[scene.own_views]", "scene.cameras.centres[:1]", OF_SPLATS,
    ),
    Mutant(
        "classes have the shapes of the colour Gaussians", "semgs/viewer/splats.py",
        'if mode in ("classes", "confidence", "things") else gaussians.colour', "if mode == 'none' else gaussians.colour", OF_SPLATS,
    ),
    Mutant(
        "the most transparent Gaussians are kept", "semgs/viewer/splats.py",
        'np.argsort(-opacities, kind="stable")', 'np.argsort(opacities, kind="stable")', OF_SPLATS,
    ),
    Mutant(
        "a click stops at the first Gaussian", "semgs/viewer/pick.py",
        "(1 - light[1:] >= SEEN_ALPHA)", "(1 - light[1:] > 0)", OF_PICKS,
    ),
    Mutant(
        "a click stops one Gaussian too late", "semgs/viewer/pick.py",
        "(1 - light[1:] >= SEEN_ALPHA)", "(1 - light[:-1] >= SEEN_ALPHA)", OF_PICKS,
    ),
    Mutant(
        "the class of a click is that of the colour pass", "semgs/viewer/pick.py",
        "drawn, light = blended(gaussians.semantic)", "pass", OF_PICKS,
    ),
    Mutant(
        "positions are relative to the scene's origin", "semgs/viewer/pick.py",
        " + torch.tensor(scene.origin, dtype=torch.float64)", "", OF_PICKS,
    ),
    Mutant(
        "a ray is turned the wrong way", "semgs/viewer/views.py",
        "as_float64(direction) @ camera.world_from_camera[:3, :3]", "camera.world_from_camera[:3, :3] @ as_float64(direction)", OF_VIEWER_CAMERAS,
    ),
    Mutant(
        "the field of view of a viewer's camera is that across", "semgs/viewer/views.py",
        "focal = height / (2 * tan(fov / 2))", "focal = width / (2 * tan(fov / 2))", OF_VIEWER_CAMERAS,
    ),
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
        "for power in (-3, -2, -1, 1, 2, 3):", "for power in (-3, -2, -1):",
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
        "there = rig.depth_unit * first", "there = first",
        ("tests/doctor/test_warps.py::test_depth_twice_as_large_disagrees_by_how_the_cameras_approach",),
    ),
    Mutant(
        "depth of another camera is read at the inverse zoom", "semgs/sfm/matches.py",
        "zooms[:, None] * offsets[:, None]", "offsets[:, None] / zooms[:, None]",
        ("tests/doctor/test_registered.py::test_depth_of_another_camera_in_the_included_room_is_named",),
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
        ("tests/cli/test_doctor_command.py::test_inverted_poses_end_with_3_and_are_corrected",),
    ),
    # Refined cameras
    Mutant(
        "epipolar distances are those of angles", "semgs/sfm/refine.py",
        "np.cross(b, baseline)) / seen.focal[:, 0]", "np.cross(b, baseline)) / seen.focal[:, 1]",
        (f"{OF_REFINE}test_a_match_3_px_below_its_epipolar_line_is_off_by_the_share_of_both_images",),
    ),
    Mutant(
        "epipolar distances are those in one image", "semgs/sfm/refine.py",
        "np.sqrt((by_first**2).sum(1) + (by_second**2).sum(1))", "np.sqrt((by_second**2).sum(1))",
        (f"{OF_REFINE}test_a_match_3_px_below_its_epipolar_line_is_off_by_the_share_of_both_images",),
    ),
    Mutant(
        "gradients stay in the world", "semgs/sfm/refine.py",
        '"mji,mj->mi", first[:, :3, :2]', '"mij,mj->mi", first[:, :2, :3]',
        (f"{OF_REFINE}test_the_distance_is_that_by_which_the_pixels_have_to_move",),
    ),
    Mutant(
        "the baseline is between the wrong cameras", "semgs/sfm/refine.py",
        "second[:, :3, 3] - first[:, :3, 3]", "second[:, :3, 3] + first[:, :3, 3]",
        (f"{OF_REFINE}test_a_match_3_px_below_its_epipolar_line_is_off_by_the_share_of_both_images",),
    ),
    Mutant(
        "matches are squared, so wrong ones win", "semgs/sfm/refine.py",
        "np.sign(distance) * np.sqrt(np.log1p(distance**2))", "distance",
        (f"{OF_REFINE}test_a_third_of_wrong_matches_does_little_harm",),
    ),
    Mutant(
        "nothing holds the cameras where they are", "semgs/sfm/refine.py",
        "np.sqrt(np.log1p(distance**2)), step))", "np.sqrt(np.log1p(distance**2)), 0 * step))",
        (f"{OF_REFINE}test_a_match_and_a_usual_error_of_one_degree_weigh_the_same_if_a_degree_moves_it_by_a_pixel",),
    ),
    Mutant(
        "cameras are usually off by one radian", "semgs/sfm/refine.py",
        "np.radians(TURN_DEG) * turn", "TURN_DEG * turn",
        (f"{OF_REFINE}test_a_match_and_a_usual_error_of_one_degree_weigh_the_same_if_a_degree_moves_it_by_a_pixel",),
    ),
    Mutant(
        "frames are taken in the order of the file", "semgs/sfm/refine.py",
        "for camera, index in enumerate(frames)}", "for camera, index in enumerate(sorted(frames))}",
        (f"{OF_REFINE}test_matches_become_rays_of_the_frames_in_the_order_given",),
    ),
    Mutant(
        "the focal length is that of the full image", "semgs/sfm/refine.py",
        "focal * matches.shrink[..., None])", "focal)",
        (f"{OF_REFINE}test_matches_become_rays_of_the_frames_in_the_order_given",),
    ),
    Mutant(
        "any improvement is taken", "semgs/sfm/refine.py",
        "accepted = after <= FALLS_TO * before", "accepted = True",
        (f"{OF_REFINE}test_good_cameras_stay_and_slightly_wrong_ones_are_corrected",),
    ),
    Mutant(
        "the median of the motion counts", "semgs/sfm/clips.py",
        "axis=1), 1 - MOVING)", "axis=1), 0.5)",
        (f"{OF_SFM}photos.py::test_walking_around_something_moves_what_is_in_front_of_it",),
    ),
    Mutant(
        "the rotation flag of a clip is ignored", "semgs/sfm/clips.py",
        "video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)", "video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)",
        (f"{OF_SFM}photos.py::test_frames_are_turned_as_the_rotation_flag_says",),
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
        "estimated cameras are written with OpenCV's axes", "semgs/sfm/writing.py",
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
        "the equivalent focal length compares widths", "semgs/files/pictures.py",
        "equivalent * math.hypot(*image.size) / _DIAGONAL_35_MM", "equivalent * max(image.size) / 36",
        (f"{OF_SFM}photos.py::test_a_focal_length_of_26_mm_compares_diagonals",),
    ),
    Mutant(
        "sparse points behind a frame are in view", "semgs/data/layouts/parts/sparse_points.py",
        "(depth > 0) & (column >= 0)", "(column >= 0)",
        ("tests/data/layouts/parts/test_sparse_points.py::test_points_in_view_are_those_in_front_and_inside",),
    ),
    Mutant(
        "a box keeps the longer of its plan's sides as its width", "semgs/robotics/boxes.py",
        "(plan.length, plan.width, float(high - low))", "(plan.width, plan.length, float(high - low))",
        ("tests/robotics/test_boxes.py::test_a_turned_box_has_its_sides_and_its_yaw",),
    ),
    Mutant(
        "a box is turned the other way", "semgs/robotics/boxes.py",
        "np.arctan2(turn[0, 1], turn[0, 0])", "np.arctan2(turn[1, 0], turn[0, 0])",
        ("tests/robotics/test_boxes.py::test_a_turned_box_has_its_sides_and_its_yaw",),
    ),
    Mutant(
        "rays free the voxels behind the side that they enter", "semgs/robotics/carving.py",
        "(cells + (steps > 0) - origins) / along", "(cells + (steps < 0) - origins) / along",
        ("tests/robotics/test_carving.py::test_random_rays_visit_what_the_slow_twin_says",),
    ),
    Mutant(
        "rays do not stop at their end", "semgs/robotics/carving.py",
        ".min(1).clip(max=1)", ".min(1)",
        ("tests/robotics/test_carving.py::test_random_rays_visit_what_the_slow_twin_says",),
    ),
    Mutant(
        "rays free what they end in and beyond", "semgs/robotics/grid.py",
        "rays.origins + along * (free / lengths.clip(min=1e-9))[:, None]", "rays.origins + along * 1.2",
        ("tests/robotics/test_occupancy_grid.py::test_what_no_ray_reached_is_never_free",),
    ),
    Mutant(
        "unseen cells are free", "semgs/robotics/grid.py",
        "[blocked, clear], [OCCUPIED, FREE], UNKNOWN", "[blocked, clear], [OCCUPIED, FREE], FREE",
        ("tests/robotics/test_occupancy_grid.py::test_what_no_ray_reached_is_never_free",),
    ),
    Mutant(
        "uncertain depth frees as much as certain depth", "semgs/robotics/grid.py",
        "lengths * np.exp(-SPREADS * rays.spread)", "lengths",
        ("tests/robotics/test_occupancy_grid.py::test_uncertain_depth_frees_less_and_gaussians_in_no_order_need_depths",),
    ),
    Mutant(
        "a table with the class of a floor is the floor", "semgs/robotics/grid.py",
        "> MOST_BELOW:", "> 1:",
        ("tests/robotics/test_occupancy_grid.py::test_the_floor_is_the_fullest_level_of_its_class_and_without_classes_the_lowest_full_one",),
    ),
    Mutant(
        "walls are things", "semgs/robotics/things.py",
        'STUFF = ("wall", "floor", "ceiling")', 'STUFF = ("floor", "ceiling")',
        ("tests/robotics/test_objects.py::test_two_chairs_are_two_things_and_walls_are_none",),
    ),
    Mutant(
        "the first row of a map has the smallest y", "semgs/export/map_files.py",
        "grey[::-1].tobytes()", "grey.tobytes()",
        ("tests/export/test_maps_for_robots.py::test_a_map_of_3x4_cells_has_these_bytes",),
    ),
    Mutant(
        "the free_thresh of other files", "semgs/export/map_files.py",
        "OCCUPIED_ABOVE, FREE_BELOW = 0.65, 0.196", "OCCUPIED_ABOVE, FREE_BELOW = 0.65, 0.25",
        ("tests/export/test_maps_for_robots.py::test_map_server_gets_our_grid_back_cell_for_cell",),
    ),
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
        "ROS: w is the first number of a quaternion", "semgs/ros/incoming.py",
        "[turn.w, turn.x, turn.y, turn.z]", "[turn.x, turn.y, turn.z, turn.w]",
        ("tests/ros/test_messages_in.py::test_four_messages_have_a_pose",),
    ),
    Mutant(
        "ROS: red and blue are swapped", "semgs/ros/incoming.py",
        "pixels_of(image)[..., ::-1]", "pixels_of(image)", ("tests/ros/test_messages_in.py::test_encodings_of_colour",),
    ),
    Mutant(
        "ROS: depth in millimetres is taken as metres", "semgs/ros/incoming.py",
        "counts * np.float32(MILLIMETRE)", "counts * np.float32(1)",
        ("tests/ros/test_messages_in.py::test_depth_becomes_metres_and_0_where_unknown",),
    ),
    Mutant(
        "ROS: the plan is in the level frame, not in that of the poses", "semgs/ros/outgoing.py",
        "frame_from_level = found.level_from_world.T", "frame_from_level = np.eye(3)",
        ("tests/ros/test_messages_out.py::test_if_y_is_down_boxes_and_plan_are_turned_into_the_frame_of_the_poses",),
    ),
    Mutant(
        "ROS: the first row of a plan has the largest y", "semgs/ros/outgoing.py",
        "found.cells.ravel()", "found.cells[::-1].ravel()",
        ("tests/ros/test_messages_out.py::test_the_grid_is_that_of_the_plan_cell_for_cell_and_the_map_turned_upside_down",),
    ),
    Mutant(
        "Rerun: the plan is upside down", "semgs/viewer/rerun_file.py",
        "found.cells[::-1].tobytes()", "found.cells.tobytes()",
        ("tests/viewer/test_rerun_file.py::test_the_plan_is_what_rerun_makes_of_the_same_plan_from_ros",),
    ),
    Mutant(
        "Rerun: w is the first number of a quaternion", "semgs/viewer/rerun_file.py",
        "quaternions.roll(-1, -1)", "quaternions",
        ("tests/cli/test_rerun_option.py::test_each_gaussian_appears_once_at_the_frame_that_it_belongs_to",),
    ),
)  # fmt: skip
