"""Errors planted in `semgs/viewer`."""

from __future__ import annotations

from planted.mutant import Mutant

OF_SPLATS = ("tests/viewer/test_splats.py",)
OF_PICKS = ("tests/viewer/test_pick.py",)
OF_VIEWER_CAMERAS = ("tests/viewer/test_viewer_views.py",)

VIEWER = (
    Mutant(
        "splats are not scaled with the world", "semgs/viewer/splat_groups.py",
        "found: Tensor = covariance(shape.quaternions, scale * shape.scales)", "found: Tensor = covariance(shape.quaternions, shape.scales)", OF_SPLATS,
    ),
    Mutant(
        "splats: colours are seen from the first input view", "semgs/scene/own_views.py",
        "scene.cameras.centres[scene.own_views]", "scene.cameras.centres[:1]", OF_SPLATS,
    ),
    Mutant(
        "classes have the shapes of the colour Gaussians", "semgs/viewer/splat_groups.py",
        'if mode in ("classes", "confidence", "things") else gaussians.colour', "if mode == 'none' else gaussians.colour", OF_SPLATS,
    ),
    Mutant(
        "the Gaussians that cover least are kept", "semgs/viewer/splat_groups.py",
        'np.argsort(-covered, kind="stable")', 'np.argsort(covered, kind="stable")', OF_SPLATS,
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
        "a ray is turned the wrong way", "semgs/viewer/viewer_cameras.py",
        "as_float64(direction) @ camera.world_from_camera[:3, :3]", "camera.world_from_camera[:3, :3] @ as_float64(direction)", OF_VIEWER_CAMERAS,
    ),
    Mutant(
        "the field of view of a viewer's camera is that across", "semgs/viewer/viewer_cameras.py",
        "focal = height / (2 * tan(fov / 2))", "focal = width / (2 * tan(fov / 2))", OF_VIEWER_CAMERAS,
    ),
    Mutant(
        "Rerun: the plan is upside down", "semgs/run/output/rerun_file.py",
        "found.cells[::-1].tobytes()", "found.cells.tobytes()",
        ("tests/run/output/test_rerun_file.py::test_the_plan_is_what_rerun_makes_of_the_same_plan_from_ros",),
    ),
    Mutant(
        "Rerun: w is the first number of a quaternion", "semgs/run/output/rerun_file.py",
        "quaternions.roll(-1, -1)", "quaternions",
        ("tests/cli/scenes/test_rerun_option.py::test_each_gaussian_appears_once_at_the_frame_that_it_belongs_to",),
    ),
)  # fmt: skip
