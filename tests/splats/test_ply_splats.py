"""3DGS PLY and compressed PLY, with numbers worked out by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from saved_scenes import wall
from splat_files import columns_3dgs, compressed_ply, known_gaussian, known_row, ply, save

from semgs.export.ply import save_ply
from semgs.files.errors import InputError
from semgs.geometry.gaussians import Gaussians
from semgs.splats.load import load_splat

Z00 = 0.28209479177387814


def assert_same(read: Gaussians, known: Gaussians) -> None:
    for name, tensor in known.tensors().items():
        assert read.tensors()[name].dtype == torch.float32
        torch.testing.assert_close(read.tensors()[name], tensor, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("order", ["binary_little_endian", "binary_big_endian", "ascii"])
@pytest.mark.parametrize("kind", ["float", "double"])
@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_every_degree_order_of_bytes_and_type_gives_the_same_gaussian(
    tmp_path: Path, order: str, kind: str, degree: int
):
    data = ply({"vertex": columns_3dgs([known_row(degree)], kind)}, order)
    splat = load_splat(save(tmp_path / "a.ply", data))
    assert_same(splat.gaussians, known_gaussian(degree))
    assert (splat.format, splat.up, dict(splat.extra), len(splat)) == ("PLY", "-y", {}, 1)


def test_properties_may_come_in_any_order_and_others_are_kept(tmp_path: Path):
    rows = [
        known_row(instance=7.0, nx=0.0, ny=0.0, nz=0.0, f_rest=2.0),
        known_row(instance=9.0, nx=0.0, ny=0.0, nz=0.0, f_rest=3.0),
    ]
    columns = columns_3dgs([dict(sorted(row.items(), reverse=True)) for row in rows])
    columns["instance"] = ("int", [7, 9])
    splat = load_splat(save(tmp_path / "a.ply", ply({"vertex": columns}, comment="from a test")))
    for index in (0, 1):
        assert_same(splat.gaussians.map(lambda tensor, index=index: tensor[index : index + 1]), known_gaussian())
    assert {name: values.tolist() for name, values in splat.extra.items()} == {"instance": [7, 9], "f_rest": [2, 3]}
    assert splat.extra["instance"].dtype.kind == "i"
    assert splat.comments == ("from a test",)


def test_normals_are_kept_if_they_say_something(tmp_path: Path):
    row = known_row(nx=0.0, ny=1.0, nz=0.0)
    assert set(load_splat(save(tmp_path / "a.ply", ply({"vertex": columns_3dgs([row])}))).extra) == {"nx", "ny", "nz"}


def test_our_own_files_come_back(tmp_path: Path):
    gaussians = wall().gaussians
    save_ply(tmp_path / "a.ply", gaussians, {"instance": np.arange(len(gaussians))})
    splat = load_splat(tmp_path / "a.ply")
    assert_same(splat.gaussians, Gaussians(gaussians.means, gaussians.opacities, gaussians.colour))
    assert splat.extra["instance"].tolist() == list(range(len(gaussians)))
    assert splat.gaussians.colour.features.shape[1] == 1  # the file has 45 zeros for each


def test_degrees_are_left_out_only_if_every_gaussian_has_zeros_there(tmp_path: Path):
    rows = [known_row(3) | {f"f_rest_{k}": 0.0 for k in range(45)} for _ in range(3)]
    rows[1]["f_rest_4"] = 0.25  # coefficient (2, -1) of red
    splat = load_splat(save(tmp_path / "a.ply", ply({"vertex": columns_3dgs(rows)})))
    assert splat.gaussians.colour.features.shape == (3, 9, 3)
    assert splat.gaussians.colour.features[1, 5].tolist() == [0.25, 0, 0]


def test_infinite_logits_are_the_opacities_0_and_1_and_flat_scales_are_0(tmp_path: Path):
    rows = [known_row(opacity=np.inf), known_row(opacity=-np.inf, scale_1=-np.inf)]
    gaussians = load_splat(save(tmp_path / "a.ply", ply({"vertex": columns_3dgs(rows)}))).gaussians
    assert gaussians.opacities.tolist() == [1, 0]
    assert gaussians.colour.scales[1].tolist()[1] == 0


def test_the_smoothing_filter_of_mip_splatting_widens_and_thins(tmp_path: Path):
    """Standard deviations of 3 cm with a filter of 4 cm become 5 cm."""
    sides = dict(zip(("scale_0", "scale_1", "scale_2"), map(np.log, (0.03, 0.03, 0.03)), strict=True))
    rows = [
        known_row(**sides, filter_3D=0.04), known_row(filter_3D=0.0), known_row(scale_0=-np.inf, filter_3D=0.5),
        known_row(scale_0=-np.inf, filter_3D=0.0),
    ]  # fmt: skip
    splat = load_splat(save(tmp_path / "a.ply", ply({"vertex": columns_3dgs(rows)})))
    scales, opacities = splat.gaussians.colour.scales, splat.gaussians.opacities
    assert scales[0].tolist() == pytest.approx([0.05] * 3)
    assert float(opacities[0]) == pytest.approx(0.5 * 0.6**3)  # 3 / 5 along each side
    assert_same(splat.gaussians.map(lambda tensor: tensor[1:2]), known_gaussian())
    assert (float(scales[2, 0]), float(opacities[2])) == (0.5, 0)
    assert (float(scales[3, 0]), float(opacities[3])) == (0, 0.5)
    assert dict(splat.extra) == {}
    assert splat.comments == ("its smoothing filter (filter_3D, Mip-Splatting) is applied",)
    with pytest.raises(InputError, match="filter_3D of Gaussian 0"):
        load_splat(save(tmp_path / "b.ply", ply({"vertex": columns_3dgs([known_row(filter_3D=-1.0)])})))


def test_other_elements_are_named_and_not_read(tmp_path: Path):
    data = ply({"vertex": columns_3dgs([known_row()]), "camera": {"focal": ("float", [500.0])}})
    splat = load_splat(save(tmp_path / "a.ply", data))
    assert splat.comments == ("element camera (1 rows) was not read",)
    assert_same(splat.gaussians, known_gaussian())


@pytest.mark.parametrize("faces", [0, 2])
@pytest.mark.parametrize("order", ["binary_little_endian", "ascii"])
def test_faces_may_follow_the_gaussians(tmp_path: Path, order: str, faces: int):
    head = f"element face {faces}\nproperty list uchar int vertex_indices\nend_header".encode()
    data = ply({"vertex": columns_3dgs([known_row()])}, order).replace(b"end_header", head)
    body = b"3 0 0 0\n" if order == "ascii" else b"\3" + bytes(12)
    splat = load_splat(save(tmp_path / "a.ply", data + faces * body))
    assert_same(splat.gaussians, known_gaussian())
    assert splat.comments == (f"element face ({faces} rows) was not read",)


@pytest.mark.parametrize("prefix", ["scalar_", "scal_"])
def test_names_may_have_the_prefix_of_cloudcompare(tmp_path: Path, prefix: str):
    """CloudCompare leaves x, y and z alone. A second opacity keeps its prefix."""
    row = {name if name in "xyz" else prefix + name: value for name, value in known_row(instance=7.0).items()}
    splat = load_splat(save(tmp_path / "a.ply", ply({"vertex": columns_3dgs([row])})))
    assert_same(splat.gaussians, known_gaussian())
    assert {name: values.tolist() for name, values in splat.extra.items()} == {"instance": [7]}
    row = known_row(**{prefix + "opacity": 9.0})
    splat = load_splat(save(tmp_path / "b.ply", ply({"vertex": columns_3dgs([row])})))
    assert_same(splat.gaussians, known_gaussian())
    assert set(splat.extra) == {prefix + "opacity"}


def test_comments_may_be_in_any_encoding(tmp_path: Path):
    data = ply({"vertex": columns_3dgs([known_row()])})
    said = b"comment C:\\M\xfcller\r\n  comment B\xc3\xbcro\nobj_info \xff\n"
    for place in (b"ply\n", b"1.0\n", b"rot_3\n"):
        splat = load_splat(save(tmp_path / "a.ply", data.replace(place, place + said, 1)))
        assert splat.comments == ("C:\\M\ufffdller", " comment B\u00fcro", "\ufffd")
        assert_same(splat.gaussians, known_gaussian())


def test_a_header_has_few_elements(tmp_path: Path):
    row = columns_3dgs([known_row()])
    others = {f"e{number}": {"x": ("float", [0.0])} for number in range(100)}
    with pytest.raises(InputError, match="expected at most 100 elements with different names, found e99 as well"):
        load_splat(save(tmp_path / "a.ply", ply({"vertex": row, **others})))


def rows_of(**changed: float) -> bytes:
    return ply({"vertex": columns_3dgs([known_row(), known_row(**changed)])})


GOOD = rows_of()
BAD = {
    "mesh": (b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0\n3 0 0 0\n", "a PLY of 3D Gaussians, found a mesh"),
    "list of each Gaussian": (rows_of().replace(b"end_header", b"property list uchar int seen_by\nend_header"), "header: expected numbers in the element vertex, found the list property seen_by, which cannot be read"),
    "list before": (rows_of().replace(b"element vertex", b"element camera 1\nproperty list uchar float k\nelement vertex"), "numbers in the element camera, found the list property k"),
    "cloud": (ply({"vertex": {name: ("float", [0.0]) for name in "xyz"}}), "a point cloud"),
    "coloured": (ply({"vertex": {name: ("uchar", [0]) for name in ("red", "green")}}), "another kind of PLY"),
    "no vertex": (ply({"points": {"x": ("float", [0.0])}}), "elements points"),
    "no opacity": (ply({"vertex": {k: v for k, v in columns_3dgs([known_row()]).items() if k != "opacity"}}), "none of the properties opacity"),
    "flat": (ply({"vertex": {k: v for k, v in columns_3dgs([known_row()]).items() if k != "scale_2"}}), "none of the properties scale_2"),
    "cut off": (GOOD[:-1], "found 183"),
    "longer": (GOOD + b"\0", "found 185"),
    "NaN": (rows_of(y=np.nan), "position of Gaussian 1: expected finite numbers, found 1, nan, 3"),
    "infinite": (rows_of(x=np.inf), "position of Gaussian 1"),
    "NaN logit": (rows_of(opacity=np.nan), "opacity of Gaussian 1"),
    "NaN harmonic": (rows_of(f_rest_3=np.nan), "harmonics of Gaussian 1"),
    "huge scale": (rows_of(scale_0=1000.0), "scale of Gaussian 1"),
    "zero quaternion": (rows_of(rot_0=0, rot_1=0, rot_2=0, rot_3=0), "rotation of Gaussian 1: expected a quaternion that is not zero"),
    "seven harmonics": (ply({"vertex": {k: v for k, v in columns_3dgs([known_row()]).items() if k not in ("f_rest_7", "f_rest_8")}}), "f_rest_0, f_rest_1"),
    "a gap": (rows_of().replace(b"f_rest_8", b"f_rest_9"), "0, 9, 24 or 45"),
    "none": (ply({"vertex": {name: ("float", []) for name in known_row()}}), "found 0"),
    "a billion": (GOOD.replace(b"vertex 2", b"vertex 999999999"), "bytes after the header"),
    "digits": (GOOD.replace(b"vertex 2", b"vertex 9999999999999"), "a line of a PLY header"),
    "negative": (GOOD.replace(b"vertex 2", b"vertex -2"), "a line of a PLY header"),
    "no format": (GOOD.replace(b"format binary_little_endian 1.0\n", b""), "a line with the format"),
    "other format": (GOOD.replace(b"little_endian 1.0", b"little_endian 2.0"), "line 2"),
    "no end": (GOOD.replace(b"end_header", b"ende"), "no end of a header"),
    "twice": (GOOD.replace(b"float y", b"float x"), "x twice"),
    "no UTF-8": (GOOD.replace(b"float y", b"float \xff"), "header: expected a PLY file"),
    "no comment": (GOOD.replace(b"ply\n", b"ply\ncommented \xff\n"), "header: expected a PLY file"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_what_is_no_splat_is_refused_in_one_line(tmp_path: Path, what: str):
    data, message = BAD[what]
    with pytest.raises(InputError) as error:
        load_splat(save(tmp_path / "a.ply", data))
    assert message in str(error.value)
    assert str(tmp_path / "a.ply") in str(error.value)


@pytest.mark.parametrize(
    ("row", "message"),
    [("1 2", "46 numbers in each line"), ("x" + " 0" * 22, "numbers in each line"), ("", "2 lines after the header")],
)
def test_texts_have_a_line_for_each_gaussian(tmp_path: Path, row: str, message: str):
    head, _, body = ply({"vertex": columns_3dgs([known_row(), known_row()])}, "ascii").partition(b"end_header\n")
    data = head + b"end_header\n" + body.splitlines()[0] + b"\n" + row.encode() + b"\n"
    with pytest.raises(InputError, match=message.replace("46", "23")):
        load_splat(save(tmp_path / "a.ply", data))


def test_whole_numbers_of_texts_are_checked(tmp_path: Path):
    columns = columns_3dgs([known_row()]) | {"kind": ("uchar", [300])}
    with pytest.raises(InputError, match="whole numbers from 0 to 255, found 300"):
        load_splat(save(tmp_path / "a.ply", ply({"vertex": columns}, "ascii")))


W, X = 0 << 30, 1 << 30
"""The largest component of packed rotations."""


def packed(
    position: tuple[int, int, int], rotation: int = W | 511 << 20 | 511 << 10 | 511, scale: int = 0, colour: int = 0
):
    x, y, z = position
    return x << 21 | y << 11 | z, rotation, scale, colour


def test_a_compressed_gaussian_is_unpacked_between_the_bounds_of_its_chunk(tmp_path: Path):
    bounds = {
        "min_x": 1.0,
        "max_x": 1.0 + 2047,
        "max_y": 1023.0,
        "max_z": 2047.0,
        "min_scale_x": -2.0,
        "max_scale_x": 0.0,
    }
    bounds |= {
        "min_scale_y": -1.0,
        "max_scale_y": -1.0,
        "min_scale_z": 0.0,
        "max_scale_z": 2047 / 1000,
        "min_r": -1.0,
        "max_r": 1.0,
    }
    rotation = X | 1023 << 20 | 0 << 10 | 511  # w = 1/sqrt 2, y = -1/sqrt 2, z nearly 0
    one = packed((5, 6, 7), rotation, scale=2047 << 21 | 77 << 11 | 500, colour=255 << 24 | 0 << 16 | 51 << 8 | 204)
    data = compressed_ply([one], [bounds], harmonics=[[0, 255, 127, 128, 0, 0, 128, 128, 128]])
    splat = load_splat(save(tmp_path / "a.ply", data))
    gaussians, shape = splat.gaussians, splat.gaussians.colour
    assert splat.format == "compressed PLY"
    assert gaussians.means.tolist() == [[6, 6, 7]]
    assert gaussians.opacities.tolist() == pytest.approx([0.8])
    assert shape.scales[0].tolist() == pytest.approx([1, np.exp(-1), np.exp(0.5)])
    rest = (511 / 1023 - 0.5) * 2**0.5
    length = (0.5 + 0.5 + rest**2) ** 0.5
    assert shape.quaternions[0].tolist() == pytest.approx(
        [0.5**0.5 / length, 0, -(0.5**0.5) / length, rest / length], abs=1e-6
    )
    assert shape.features[0, 0].tolist() == pytest.approx([(1 - 0.5) / Z00, -0.5 / Z00, -0.3 / Z00])
    below, above = -0.5 / 256 * 8, 0.5 / 256 * 8
    expected = [[-4, above, above], [4, -4, above], [below, -4, above]]  # coefficient by coefficient: red, green, blue
    np.testing.assert_allclose(shape.features[0, 1:].numpy(), expected, rtol=1e-6)


@pytest.mark.parametrize("largest", range(4))
def test_the_two_top_bits_say_which_of_w_x_y_z_is_largest(tmp_path: Path, largest: int):
    one = packed((0, 0, 0), largest << 30 | 600 << 20 | 500 << 10 | 400)
    quaternion = load_splat(save(tmp_path / "a.ply", compressed_ply([one], [{}]))).gaussians.colour.quaternions[0]
    others = [(value / 1023 - 0.5) * 2**0.5 for value in (600, 500, 400)]
    expected = [*others[:largest], (1 - sum(value**2 for value in others)) ** 0.5, *others[largest:]]
    assert quaternion.tolist() == pytest.approx(expected, abs=1e-6)


def test_gaussian_256_is_the_first_of_the_second_chunk_and_colours_may_have_no_bounds(tmp_path: Path):
    data = compressed_ply([packed((2047, 0, 0), colour=255 << 24)] * 257, [{}, {"max_x": 9.0}], colours=False)
    gaussians = load_splat(save(tmp_path / "a.ply", data)).gaussians
    assert gaussians.means[:, 0].tolist() == [1.0] * 256 + [9.0]
    assert gaussians.colour.features[0, 0].tolist() == pytest.approx([0.5 / Z00, -0.5 / Z00, -0.5 / Z00])


ONE = packed((0, 0, 0))
BAD_COMPRESSED = {
    "few chunks": (compressed_ply([ONE] * 257, [{}]), "1 for 257 Gaussians"),
    "many chunks": (compressed_ply([ONE], [{}, {}]), "2 for 1 Gaussians"),
    "NaN bounds": (compressed_ply([ONE], [{"min_y": np.nan}]), "bounds of Gaussian 0"),
    "few harmonics": (compressed_ply([ONE, ONE], [{}], harmonics=[[0] * 9]), "1 for 2 Gaussians"),
    "eight harmonics": (compressed_ply([ONE], [{}], harmonics=[[0] * 8]), "0, 9, 24 or 45"),
    "no chunk": (ply({"vertex": {f"packed_{name}": ("uint", [0]) for name in ("position", "rotation", "scale", "color")}}), "min_x, as in a compressed PLY"),
    "no rotation": (compressed_ply([ONE], [{}]).replace(b"packed_rotation", b"packed_rotatiom"), "packed_rotation, as in"),
    "floats": (compressed_ply([ONE], [{}]).replace(b"uint packed_scale", b"float packed_scale"), "32-bit unsigned"),
    "half of the colours": (compressed_ply([ONE], [{}]).replace(b"max_b", b"max_c"), "max_b, as in"),
    "huge scale": (compressed_ply([packed((0, 0, 0), scale=2**32 - 1)], [{"max_scale_x": 999.0}]), "scale of Gaussian 0"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD_COMPRESSED)
def test_compressed_files_that_contradict_themselves_are_refused(tmp_path: Path, what: str):
    data, message = BAD_COMPRESSED[what]
    with pytest.raises(InputError, match=message):
        load_splat(save(tmp_path / "a.ply", data))


def test_positions_that_32_bits_would_move_by_more_than_the_gaussians_are_large_are_refused(tmp_path: Path):
    """Numbers of 32 bits have steps of half a metre at 5,000 km: 5,000,000.25 m becomes 5,000,000 m. The Gaussian is 5 cm large."""
    sides = dict(zip(("scale_0", "scale_1", "scale_2"), map(np.log, (0.05, 0.04, 0.03)), strict=True))
    columns = columns_3dgs([known_row(y=5_000_000.25, **sides)], "double")
    with pytest.raises(
        InputError, match=r"positions 5e\+06 from it, which 32 bits round by 0.25; Gaussians are 0.05 large"
    ):
        load_splat(save(tmp_path / "a.ply", ply({"vertex": columns})))
    rounded = load_splat(save(tmp_path / "b.ply", ply({"vertex": columns_3dgs([known_row(y=5_000_000.25, **sides)])})))
    assert rounded.gaussians.means.tolist() == [[1, 5_000_000, 3]]  # the file has no more
