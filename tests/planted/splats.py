"""Errors planted in `semgs/splats`."""

from __future__ import annotations

from planted.mutant import Mutant

OF_PLY = ("tests/splats/test_ply_splats.py",)
OF_SPZ = ("tests/splats/test_spz_splats.py",)
OF_GLTF = ("tests/splats/test_gltf_splats.py",)
OF_SCENES = ("tests/splats/test_splat_scene.py",)

OF_FEATURES = "tests/splats/test_fit_by_features.py::"

SPLATS = (
    Mutant(
        "splats: a similarity by features has no scale", "semgs/splats/fit_by_features.py",
        "world = np.exp(trial[6]) * own.positions", "world = own.positions",
        (OF_FEATURES + "test_a_splat_in_other_coordinates_is_moved_to_the_photos",),
    ),
    Mutant(
        "splats: what features say is applied without a look at the photos", "semgs/splats/scene_opening.py",
        "    if not as_found.clearly_beats(looks):\n        return moved\n", "",
        (OF_FEATURES + "test_a_motion_that_does_not_look_clearly_better_is_not_applied",),
    ),
    Mutant(
        "splats: right cameras are corrected by less than a pixel", "semgs/splats/fit_by_features.py",
        "if still >= within:", "if still >= 0:",
        (OF_FEATURES + "test_features_that_stay_within_two_per_cent_say_that_the_cameras_fit",),
    ),
    Mutant(
        "splats: big endian is read as little endian", "semgs/data/ply_tables.py",
        '"binary_big_endian": ">"', '"binary_big_endian": "<"', OF_PLY,
    ),
    Mutant(
        "splats: a comment that is not UTF-8 makes a PLY unreadable", "semgs/data/ply_tables.py",
        '"replace" if _REMARK.match(line) else "strict"', '"strict"', OF_PLY,
    ),
    Mutant(
        "splats: harmonics of a PLY are read coefficient by coefficient", "semgs/splats/plain_ply.py",
        "(first + number % per_channel, number // per_channel, name)", "(first + number // 3, number % 3, name)", OF_PLY,
    ),
    Mutant(
        "splats: scales of a PLY are not logarithms", "semgs/splats/plain_ply.py",
        "scales if lengths else np.exp(scales)", "scales if lengths else np.abs(scales)", OF_PLY,
    ),
    Mutant(
        "splats: a degree is left out if one Gaussian has zeros there", "semgs/splats/splat.py",
        "used].any():", "used].all():", OF_PLY,
    ),
    Mutant(
        "splats: a chunk of a compressed PLY has 255 Gaussians", "semgs/splats/compressed_ply.py",
        "np.arange(count) // CHUNK_SIZE", "np.arange(count) // (CHUNK_SIZE - 1)", OF_PLY,
    ),
    Mutant(
        "splats: the y of packed positions has 11 bits too", "semgs/splats/compressed_ply.py",
        "((21, 11), (11, 10), (0, 11))", "((21, 11), (10, 11), (0, 11))", OF_PLY,
    ),
    Mutant(
        "splats: packed rotations count x, y, z, w", "semgs/splats/compressed_ply.py",
        "return with_largest(others, (packed >> np.uint32(30)).astype(np.int64))",
        "return np.roll(with_largest(others, (packed >> np.uint32(30)).astype(np.int64)), 1, axis=-1)",
        OF_PLY,
    ),
    Mutant(
        "splats: SPZ stays with y up", "semgs/splats/spz.py",
        "means=fixed / 2.0**packed.fractional_bits * FLIP,", "means=fixed / 2.0**packed.fractional_bits,", OF_SPZ,
    ),
    Mutant(
        "splats: harmonics of SPZ are not turned with the positions", "semgs/splats/spz.py",
        "    rest *= HARMONICS_FLIP[: rest.shape[1], None]\n", "", OF_SPZ,
    ),
    Mutant(
        "splats: positions of SPZ have no sign", "semgs/splats/spz.py",
        "(low | middle << 8 | high << 16) << 8 >> 8", "(low | middle << 8 | high << 16)", OF_SPZ,
    ),
    Mutant(
        "splats: the colours of SPZ have the factor of the constant harmonic", "semgs/splats/spz.py",
        "1, 3) / 255 - 0.5) / 0.15", "1, 3) / 255 - 0.5) / 0.28209479", OF_SPZ,
    ),
    Mutant(
        "splats: a gzip stream is inflated to its end", "semgs/splats/spz.py",
        "stream.decompress(stream.unconsumed_tail, most + 1)", "stream.decompress(stream.unconsumed_tail)", OF_SPZ,
    ),
    Mutant(
        "splats: quaternions of glTF have w first", "semgs/splats/gltf_splat.py",
        "quaternions=np.roll(rotations, 1, axis=-1),", "quaternions=rotations,", OF_GLTF,
    ),
    Mutant(
        "splats: matrices of glTF are read row by row", "semgs/splats/gltf_splat.py",
        "matrix.ravel()).reshape(4, 4).T", "matrix.ravel()).reshape(4, 4)", OF_GLTF,
    ),
    Mutant(
        "splats: a node of glTF does not scale its Gaussians", "semgs/splats/gltf_splat.py",
        "move_gaussians(rigid, gaussians, scale=float(scale))", "move_gaussians(rigid, gaussians)", OF_GLTF,
    ),
    Mutant(
        "splats: nerfstudio's scale is undone after its transform", "semgs/splats/nerfstudio_frame.py",
        "        inverse[:3, 3] -= torch", "        inverse[:3, 3] /= self.scale\n        inverse[:3, 3] -= torch",
        OF_SCENES,
    ),
    Mutant(
        "splats: applied_transform stays in nerfstudio's transform", "semgs/splats/nerfstudio_frame.py",
        "saved = saved @ np.linalg.inv(applied)", "saved = saved @ applied", OF_SCENES,
    ),
    Mutant(
        "splats: a hidden Gaussian counts as seen", "semgs/splats/splat_scene.py",
        "z <= (1 + SAME) * depths[view, row, column]", "z > 0", OF_SCENES,
    ),
    Mutant(
        "splats: cameras around an object look up", "semgs/splats/splat_cameras.py",
        "* level - sin(radians(elevation)) * up", "* level + sin(radians(elevation)) * up", OF_SCENES,
    ),
    Mutant(
        "splats: floaters move the cameras", "semgs/splats/splat_cameras.py",
        "LOW, HIGH = 0.05, 0.95", "LOW, HIGH = 0.0, 1.0", OF_SCENES,
    ),
    Mutant(
        "splats: -128 of a normalised byte is less than -1", "semgs/files/gltf_container.py",
        "np.maximum(values / np.iinfo(values.dtype).max, -1)", "values / np.iinfo(values.dtype).max", ("tests/splats/test_gltf_splats.py::test_a_byte_of_minus_128_is_minus_one",),
    ),
    Mutant(
        "splats: lengths are taken for logarithms", "semgs/splats/plain_ply.py",
        "look_like_lengths(scales, means) if activated is None", "False if activated is None", ("tests/splats/test_splats_as_found.py",),
    ),
    Mutant(
        "splats: of columns of their own, broken Gaussians keep their rows", "semgs/splats/plain_ply.py",
        "values[usable.kept]", "np.array(values)", ("tests/splats/test_splats_as_found.py::test_columns_of_ones_own_lose_the_row_too",),
    ),
)  # fmt: skip
