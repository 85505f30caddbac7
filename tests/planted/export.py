"""Errors planted in `semgs/export`."""

from __future__ import annotations

from planted.mutant import Mutant

OF_CAMERA_FILES = ("tests/export/test_camera_files.py",)
OF_CONFIDENCE = ("tests/scene/test_confidence.py",)

EXPORT = (
    Mutant(
        "the field of view of a camera path is horizontal", "semgs/export/camera_files.py",
        "focal_px = height / 2 /", "focal_px = width / 2 /", OF_CAMERA_FILES,
    ),
    Mutant(
        "a camera path in radians is one of very small angles", "semgs/export/camera_files.py",
        "if max(fovs) < pi:", "if max(fovs) < 0:", OF_CAMERA_FILES,
    ),
    Mutant(
        "cameras of files have OpenCV axes", "semgs/export/camera_files.py",
        "pose.reshape(4, 4) @ OPENCV_FROM_OPENGL", "pose.reshape(4, 4)", OF_CAMERA_FILES,
    ),
    Mutant(
        "colour with transparency is darkened twice", "semgs/export/stills.py",
        "rendering.images[0] / rendering.alphas[0].clamp(min=LEAST_ALPHA)", "rendering.images[0]", ("tests/export/test_stills.py",),
    ),
    Mutant(
        "a Gaussian takes the temperature of pixels", "semgs/scene/confidence.py",
        "scene.temperatures.gaussians", "scene.temperatures.rendered", OF_CONFIDENCE,
    ),
    Mutant(
        "a pixel takes the temperature of Gaussians", "semgs/scene/scene_file.py",
        "self.temperatures.rendered", "self.temperatures.gaussians", OF_CONFIDENCE,
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
        "USD has quaternions with w first", "semgs/export/usd.py",
        "quaternions.roll(-1, dims=-1)", "quaternions", ("tests/export/test_usd.py",),
    ),
    Mutant(
        "USD has the logarithm of scales", "semgs/export/usd.py",
        '"scales": gaussians.colour.scales,', '"scales": gaussians.colour.scales.log(),', ("tests/export/test_usd.py",),
    ),
    Mutant(
        "USD has the number of harmonics for their degree", "semgs/export/usd.py",
        "round(harmonics.shape[1] ** 0.5) - 1", "harmonics.shape[1]", ("tests/export/test_usd.py",),
    ),
    Mutant(
        "the label of a prim is its name", "semgs/export/usd.py",
        "wanted = [*scene.classes.names, None]", "wanted = [*prims[:-1], None]", ("tests/export/test_usd.py",),
    ),
    Mutant(
        "the bounds of Gaussians turn the wrong way", "semgs/export/usd.py",
        "REACH * axes.norm(dim=-1)", "REACH * axes.norm(dim=-2)", ("tests/export/test_usd.py",),
    ),
    Mutant(
        "a scene of unknown unit is in metres", "semgs/export/usd.py",
        'if scene.unit == "metric":', "if True:", ("tests/export/test_usd.py",),
    ),
    Mutant(
        "boxes of USD hide the Gaussians", "semgs/export/usd.py",
        "UsdGeom.Tokens.guide", "UsdGeom.Tokens.default_", ("tests/export/test_usd.py",),
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
    Mutant(
        "a scene file's cameras stay about the origin", "semgs/scene/scene_file.py",
        "in_source.relative_to([-side for side in scene.origin])", "in_source", ("tests/scene/test_scene_file.py",),
    ),
    Mutant(
        "exports: lines of the detector are half a pixel off", "semgs/scene/own_views.py",
        "reshape(-1, 2, 2) + OFFSET_PX)", "reshape(-1, 2, 2))", ("tests/scene/test_upright.py",),
    ),
    Mutant(
        "exports: normals of lines stay in the camera's frame", "semgs/scene/own_views.py",
        "normals @ scene.cameras.world_from_camera[view, :3, :3].T", "normals", ("tests/scene/test_upright.py",),
    ),
    Mutant(
        "exports: every point has the colour that the first view sees", "semgs/scene/own_views.py",
        "scene.cameras.centres[scene.own_views]", "scene.cameras.centres[:1]",
        ("tests/export/test_points.py",),
    ),
    Mutant(
        "exports: the matrix back forgets the scene's origin", "semgs/scene/upright.py",
        "return FramedScene(moved, turned @ _to_origin(scene), axes)", "return FramedScene(moved, turned, axes)",
        ("tests/scene/test_upright.py",),
    ),
    Mutant(
        "exports: export.json has the inverse matrix", "semgs/export/export_record.py",
        "file.framed.source_from_file", "file.framed.file_from_source", ("tests/cli/scenes/test_export_command.py",),
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
        "labels are floats", "semgs/data/ply_tables.py",
        '"uchar" if values.dtype == np.uint8 else "float"', '"float"',
        ("tests/export/test_ply.py::test_further_columns_follow_those_of_3dgs_and_comments_come_before_them",),
    ),
    Mutant(
        "labels are those of all Gaussians, not of the kept ones", "semgs/export/scene_export.py",
        "{name: values[self.keep.numpy()] for name, values in self._extra().items()}", "{name: values[: int(self.keep.sum())] for name, values in self._extra().items()}",
        ("tests/cli/scenes/test_export_command.py::test_labels_and_confidence_are_columns_of_the_ply_where_asked",),
    ),
    Mutant(
        "colours of boxes are those of sRGB", "semgs/export/gltf.py",
        "round((side / 255) ** 2.2, 4)", "round(side / 255, 4)", ("tests/export/test_gltf.py::test_the_colour_of_a_box_is_linear",),
    ),
)  # fmt: skip
