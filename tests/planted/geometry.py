"""Errors planted in `semgs/geometry`."""

from __future__ import annotations

from planted.mutant import Mutant

CAMERAS = "semgs/geometry/cameras.py"
ROTATIONS = "semgs/geometry/rotations.py"
HARMONICS = "semgs/geometry/harmonics.py"
SWEEP = "semgs/geometry/plane_sweep.py"
OF_CAMERAS = ("tests/geometry/test_cameras.py",)
OF_HARMONICS = ("tests/geometry/test_harmonics.py",)
OF_SWEEP = ("tests/geometry/test_sweep_grid.py",)
OF_COST = ("tests/model/sweep/test_cost_volume.py::test_the_cost_equals_a_loop_over_pixels_and_planes",)
OF_CAMERA_PATHS = ("tests/geometry/test_camera_paths.py",)

GEOMETRY = (
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
        "harmonics are turned the other way", "semgs/geometry/harmonics.py",
        "turned = directions @ rotations ", "turned = directions @ rotations.mT ",
        ("tests/geometry/test_harmonics_rotation.py",),
    ),
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
        "one part of a kernel's work is left out", "semgs/runtime/kernels.py",
        "for part in range(parts)]", "for part in range(parts - 1)]", ("tests/runtime/test_kernels.py",),
    ),
    Mutant(
        "what a kernel calls is compiled twice, by the clock", "semgs/runtime/stopwatch.py",
        "            if self.depth == 0:\n                self.seconds +=", "            if True:\n                self.seconds +=",
        ("tests/runtime/test_stopwatch.py",),
    ),
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
        "an origin is added for subtracted", CAMERAS, "poses[..., :3, 3] -= as_float64(origin)", "poses[..., :3, 3] += as_float64(origin)",
        ("tests/scene/test_scene_file.py", "tests/run/test_reconstruct.py"),
    ),
    Mutant(
        "arrays that run backwards are passed on", "semgs/geometry/cameras.py",
        "min(native.strides, default=0) >= 0", "True",
        ("tests/data/test_array_checks.py::test_arrays_that_run_backwards_are_copied",),
    ),
    Mutant(
        "views vote that see something nearer", "semgs/geometry/fusion.py",
        "return inside & (", "return inside | (",
        ("tests/geometry/test_fusion.py::test_fusion_equals_a_loop_over_points_and_views",),
    ),
)  # fmt: skip
