"""Gaussians in glTF, with numbers worked out by hand."""

from __future__ import annotations

import copy
import json
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
import torch
from saved_scenes import wall
from splat_files import SPLAT, glb, gltf, gltf_arrays, gltf_text, known_gaussian, save
from traced_memory import most_memory

from semgs.export.gltf import save_gltf
from semgs.files.errors import InputError
from semgs.geometry.gaussians import move_gaussians
from semgs.runtime.notes import Note
from semgs.splats.load import load_splat
from semgs.splats.splat import Splat


def read(tmp_path: Path, data: bytes, name: str = "a.glb") -> Splat:
    return load_splat(save(tmp_path / name, data))


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_a_gaussian_has_plain_numbers_and_keeps_its_coordinates(tmp_path: Path, degree: int):
    splat = read(tmp_path, glb(*gltf(gltf_arrays(degree))))
    for name, tensor in known_gaussian(degree).tensors().items():
        torch.testing.assert_close(splat.gaussians.tensors()[name], tensor, rtol=1e-6, atol=1e-6)
    assert (splat.format, splat.up, splat.comments) == ("glTF", "y", ("by hand",))


def test_a_text_has_its_buffer_inside_or_in_a_file_beside_it(tmp_path: Path):
    content, body = gltf(gltf_arrays())
    (tmp_path / "buffers of it").mkdir()
    save(tmp_path / "buffers of it" / "a.bin", body)
    for data in (gltf_text(content, body), gltf_text(content, body, "buffers%20of%20it/a.bin")):
        assert read(tmp_path, data, "a.gltf").gaussians.means.tolist() == [[1, -2, 3]]


def test_our_own_files_come_back_with_classes_and_confidence(tmp_path: Path):
    scene = wall()
    save_gltf(tmp_path / "a.glb", scene)
    splat = load_splat(tmp_path / "a.glb")
    for name in ("means", "opacities", "colour.quaternions", "colour.scales", "colour.features"):
        torch.testing.assert_close(splat.gaussians.tensors()[name], scene.gaussians.tensors()[name])
    assert scene.gaussians.semantic is not None
    assert splat.extra["_CLASS"].tolist() == scene.gaussians.semantic.features.argmax(-1).tolist()
    assert splat.extra["_CONFIDENCE"][0] == pytest.approx(0.81)


def test_quaternions_have_w_last_and_integers_stand_for_shares(tmp_path: Path):
    arrays = gltf_arrays()
    arrays[f"{SPLAT}:ROTATION"] = np.array([[0, 0, 32767, 0]], "<i2")
    arrays[f"{SPLAT}:OPACITY"] = np.array([[51, 0, 0, 0]], "u1")[:, :1]
    gaussians = read(tmp_path, glb(*gltf(arrays))).gaussians
    assert gaussians.colour.quaternions.tolist() == [[0, 0, 0, 1]]
    assert gaussians.opacities.tolist() == pytest.approx([0.2])


def test_rows_may_be_interleaved(tmp_path: Path):
    arrays = {name: np.repeat(values, 2, 0) for name, values in gltf_arrays().items()}
    arrays["POSITION"] = np.array([[1, 2, 3], [4, 5, 6]], "<f4")
    content, body = gltf(arrays)
    rows = np.column_stack((arrays["POSITION"], np.full((2, 1), np.nan))).astype("<f4").tobytes()
    content["bufferViews"][0] = {"buffer": 0, "byteOffset": len(body), "byteLength": len(rows), "byteStride": 16}
    content["buffers"] = [{"byteLength": len(body) + len(rows)}]
    assert read(tmp_path, glb(content, body + rows)).gaussians.means.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_nodes_turn_scale_and_move(tmp_path: Path):
    half = sqrt(0.5)  # a quarter turn about z: x becomes y
    node = {"rotation": [0, 0, half, half], "scale": [2, 2, 2], "translation": [10, 20, 30]}
    gaussians = read(tmp_path, glb(*gltf(gltf_arrays(2), node))).gaussians
    assert gaussians.means.tolist() == [pytest.approx([10 + 4, 20 + 2, 30 + 6])]
    turn = torch.eye(4, dtype=torch.float64)
    turn[:2, :2] = torch.tensor([[0.0, -1], [1, 0]])
    expected = move_gaussians(turn, known_gaussian(2)).colour
    torch.testing.assert_close(gaussians.colour.features, expected.features, rtol=1e-5, atol=1e-5)
    torch.testing.assert_close(gaussians.colour.scales, 2 * expected.scales)
    assert abs(float((gaussians.colour.quaternions * expected.quaternions).sum())) == pytest.approx(1, abs=1e-6)


def test_nodes_that_move_further_than_32_bits_can_say_are_refused(tmp_path: Path):
    """Numbers of 32 bits have steps of 8 at 100 million: 1 + 100,000,002 becomes 100,000,000. The Gaussian is 2 large."""
    with pytest.raises(InputError, match=r"positions 1e\+08 from it, which 32 bits round by 3; Gaussians are 2 large"):
        read(tmp_path, glb(*gltf(gltf_arrays(), {"translation": [100_000_002, 0, 0]})))


def test_nodes_below_nodes_and_matrices_column_by_column(tmp_path: Path):
    content, body = gltf(gltf_arrays())
    moved = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1]
    content["nodes"] = [{"children": [1, 2], "scale": [3, 3, 3]}, {"mesh": 0, "matrix": moved}, {"mesh": 0}]
    content["meshes"].append({"primitives": [{"attributes": {}, "mode": 1}]})
    content["nodes"].append({"mesh": 1})  # the lines of a box
    content["scenes"][0]["nodes"] = [0, 3]
    assert read(tmp_path, glb(content, body)).gaussians.means.tolist() == [[18, 12, 30], [3, -6, 9]]


def changed(path: str, value: object, arrays: dict | None = None) -> bytes:
    """A file with one value of its JSON replaced, or removed if it is None."""
    content, body = gltf(arrays or gltf_arrays())
    content = copy.deepcopy(content)
    *way, last = [int(key) if key.isdigit() else key for key in path.split("/")]
    place = content
    for key in way:
        place = place[key]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return glb(content, body)


PRIMITIVE = "meshes/0/primitives/0"
SETTINGS = f"{PRIMITIVE}/extensions/{SPLAT}"
GOOD = glb(*gltf(gltf_arrays()))
BAD = {
    "a mesh": (changed(f"{PRIMITIVE}/extensions", None), "Gaussians (KHR_gaussian_splatting), found none"),
    "no scene": (changed("scenes", None), "an object of scenes"),
    "no rotation": (changed(f"{PRIMITIVE}/attributes/{SPLAT}:ROTATION", None), "ROTATION, found none"),
    "no constant": (changed(f"{PRIMITIVE}/attributes/{SPLAT}:SH_DEGREE_0_COEF_0", None), "SH_DEGREE_0_COEF_0, found none"),
    "half a degree": (changed(f"{PRIMITIVE}/attributes/{SPLAT}:SH_DEGREE_1_COEF_1", None), "SH_DEGREE_1_COEF_1, found none"),
    "degree 4": (changed(f"{PRIMITIVE}/attributes/{SPLAT}:SH_DEGREE_4_COEF_0", 0), "harmonics of degree 0 to 3, found degree 4"),
    "linear colours": (changed(f"{SETTINGS}/colorSpace", "lin_rec709_display"), "lin_rec709_display"),
    "kernel": (changed(f"{SETTINGS}/kernel", "box"), "expected ellipse"),
    "compressed": (changed(f"{SETTINGS}/extensions", {"KHR_gaussian_splatting_compression_spz_2": {}}), "Gaussians that are not compressed"),
    "required": (changed("extensionsRequired", ["KHR_draco_mesh_compression"]), "no required extension"),
    "sparse": (changed("accessors/0/sparse", {"count": 1}), "a sparse one"),
    "many rows": (changed("accessors/0/count", 10**9), "50,000,000 Gaussians"),
    "rows outside": (changed("accessors/1/count", 10**6), "rows inside the buffer"),
    "negative": (changed("accessors/0/count", -1), "a whole number, found -1"),
    "a truth": (changed("accessors/0/count", True), "a whole number, found True"),
    "offset": (changed("accessors/0/byteOffset", 4), "rows inside the buffer"),
    "view outside": (changed("bufferViews/0/byteLength", 10**6), "a part of the"),
    "no view": (changed("accessors/0/bufferView", 99), "an object of bufferViews"),
    "type": (changed("accessors/0/type", "MAT4"), "scalars or vectors"),
    "width": (changed("accessors/0/type", "VEC2"), "3 numbers for each Gaussian, found 2"),
    "stride": (changed("bufferViews/0/byteStride", 8), "a stride of at least 12 bytes"),
    "a ring of nodes": (changed("nodes/0/children", [0]), "each node once"),
    "stretched": (changed("nodes/0/scale", [1, 1, 2]), "one that stretches or mirrors"),
    "mirrored": (changed("nodes/0/scale", [-1, -1, -1]), "one that stretches or mirrors"),
    "flat": (changed("nodes/0/scale", [0, 0, 0]), "one that stretches or mirrors"),
    "node numbers": (changed("nodes/0/translation", [1, 2]), "3 finite numbers"),
    "node turn": (changed("nodes/0/rotation", [0, 0, 0, 0]), "a quaternion of unit length"),
    "version 1": (changed("asset/version", "1.0"), "glTF 2.0, found '1.0'"),
    "no asset": (changed("asset", []), "glTF 2.0"),
    "no buffer": (changed("buffers/0/uri", 7), "a text"),
    "absolute": (changed("buffers/0/uri", "/etc/hostname"), "a file in the same folder"),
    "above": (changed("buffers/0/uri", "x/../../a.bin"), "a file in the same folder"),
    "escaped": (changed("buffers/0/uri", "%2e%2e/a.bin"), "a file in the same folder"),
    "a site": (changed("buffers/0/uri", "https://example.org/a.bin"), "a file in the same folder"),
    "missing": (changed("buffers/0/uri", "b.bin"), "a buffer whose file exists"),
    "no base64": (changed("buffers/0/uri", "data:application/octet-stream;base64,???"), "data in base64"),
    "counts": (glb(*gltf({**gltf_arrays(), f"{SPLAT}:OPACITY": np.zeros((2, 1), "<f4")})), "attributes of one length"),
    "zero quaternion": (glb(*gltf({**gltf_arrays(), f"{SPLAT}:ROTATION": np.zeros((1, 4), "<f4")})), "rotation of Gaussian 0"),
    "NaN": (glb(*gltf({**gltf_arrays(), "POSITION": np.full((1, 3), np.nan, "<f4")})), "position of Gaussian 0"),
    "opacity": (glb(*gltf({**gltf_arrays(), f"{SPLAT}:OPACITY": np.full((1, 1), 1.5, "<f4")})), "0 to 1, found 1.5"),
    "negative scale": (glb(*gltf({**gltf_arrays(), f"{SPLAT}:SCALE": np.full((1, 3), -1, "<f4")})), "0 or more"),
    "cut off": (GOOD[:-4], "as its header says"),
    "chunk": (GOOD[:12] + b"\xff\xff\xff\x7f" + GOOD[16:], "one that is cut off"),
    "no JSON": (GOOD.replace(b"JSON", b"XML ", 1), "a first chunk with JSON"),
    "GLB of version 1": (GOOD[:4] + b"\1" + GOOD[5:], "GLB of version 2"),
    "bad JSON": (GOOD.replace(b'{"asset"', b'["asset"', 1), "JSON"),
}  # fmt: skip


def test_a_mesh_that_many_nodes_use_takes_no_more_memory_than_the_file_has(tmp_path: Path):
    content, body = gltf(gltf_arrays())
    content["nodes"] = [{"mesh": 0}] * 20
    content["scenes"][0]["nodes"] = list(range(20))
    with pytest.raises(InputError, match=rf"at most {len(body) // 6} Gaussians in {len(body)} bytes, found 20"):
        read(tmp_path, glb(content, body))


@pytest.mark.parametrize("what", BAD)
def test_what_cannot_be_read_is_refused_in_one_line(tmp_path: Path, what: str):
    data, message = BAD[what]
    save(tmp_path.parent / "a.bin", b"")
    with pytest.raises(InputError) as error:
        read(tmp_path, data)
    assert message in str(error.value)
    assert str(tmp_path / "a.glb") in str(error.value)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.ply", b"", "an empty file"),
        ("a.ply", b"solid cube", "another kind of file"),
        ("a.gltf", b'{"frames": []}', "another kind of file"),
    ],
)
def test_the_content_says_what_a_file_is(tmp_path: Path, name: str, data: bytes, message: str):
    with pytest.raises(InputError, match=message):
        read(tmp_path, data, name)
    assert read(tmp_path, GOOD, "wrong.ply").format == "glTF"


def test_a_folder_or_nothing_is_refused(tmp_path: Path):
    for path, found in ((tmp_path, "no file"), (tmp_path / "no.ply", "no such file")):
        with pytest.raises(InputError, match=found):
            load_splat(path)


def test_buffers_of_one_file_are_read_once(tmp_path: Path):
    content, body = gltf(gltf_arrays())
    save(tmp_path / "a.bin", body + bytes(1_000_000))
    text = json.loads(gltf_text(content, body, "a.bin"))
    text["buffers"] *= 200
    path = save(tmp_path / "a.gltf", json.dumps(text).encode())
    assert load_splat(path).gaussians.means.tolist() == [[1, -2, 3]]
    assert most_memory(lambda: load_splat(path)) < 20_000_000


def test_a_byte_of_minus_128_is_minus_one(tmp_path: Path):
    """max(c / 127, -1), as the specification of glTF says: -128 / 127 would be less than -1."""
    arrays = gltf_arrays(0)
    content, body = gltf(arrays)
    rotation = next(
        i
        for i, one in enumerate(content["accessors"])
        if one
        is content["accessors"][content["meshes"][0]["primitives"][0]["attributes"]["KHR_gaussian_splatting:ROTATION"]]
    )
    view = content["bufferViews"][content["accessors"][rotation]["bufferView"]]
    count = content["accessors"][rotation]["count"]
    body = bytearray(body)
    start = view.get("byteOffset", 0)
    packed = np.tile(np.array([-128, 127, 0, 0], np.int8), (count, 1)).tobytes()
    body[start : start + len(packed)] = packed
    content["accessors"][rotation] |= {"componentType": 5120, "normalized": True}
    splat = load_splat(save(tmp_path / "a.glb", glb(content, bytes(body))))
    torch.testing.assert_close(splat.gaussians.colour.quaternions[0], torch.tensor([0, -(0.5**0.5), 0.5**0.5, 0]))


def logs_glb(scale: tuple[float, ...], opacities: tuple[float, ...], footprint: float | None = None) -> bytes:
    """60 equal Gaussians, whose opacities repeat."""
    arrays = {name: np.repeat(values, 60, 0) for name, values in gltf_arrays().items()}
    arrays[f"{SPLAT}:SCALE"] = np.full((60, 3), scale, "<f4")
    arrays[f"{SPLAT}:OPACITY"] = np.resize(opacities, (60, 1)).astype("<f4")
    if footprint is not None:
        arrays["_FOOTPRINT"] = np.full((60, 1), footprint, "<f4")
    return glb(*gltf(arrays))


def test_scales_that_are_mostly_negative_are_logarithms_and_a_note_says_so(tmp_path: Path):
    """exp(-3) = 0.0498, exp(-2) = 0.1353, exp(0.5) = 1.6487; opacities, 0.25, are those of the specification."""
    splat = read(tmp_path, logs_glb((-3, -2, 0.5), (0.25,)))
    assert splat.gaussians.colour.scales[1].tolist() == pytest.approx([0.049787, 0.135335, 1.648721], rel=1e-5)
    assert splat.gaussians.opacities.tolist() == [0.25] * 60
    assert [(note, note.on_page) for note in splat.notes if isinstance(note, Note)] == [
        (
            "Scales look like logarithms, not like lengths, and are read as such; --activated yes reads lengths.",
            "Scales look like logarithms, not like lengths, and are read as such.",
        )
    ]


def test_opacities_that_are_mostly_outside_0_to_1_are_logits_and_a_note_says_so(tmp_path: Path):
    """1 / (1 + exp(2)) = 0.1192, 1 / (1 + exp(-2)) = 0.8808; scales, 1, 2 and 1/e, are those of the specification."""
    splat = read(tmp_path, logs_glb((1, 2, 1 / np.e), (-2, 2, 0)))
    assert splat.gaussians.opacities[:3].tolist() == pytest.approx([0.119203, 0.880797, 0.5], rel=1e-5)
    assert splat.gaussians.colour.scales[0].tolist() == pytest.approx([1, 2, 0.367879], rel=1e-5)
    assert [note[:27] for note in splat.notes] == ["Opacities look like logits,"]


def test_what_the_user_says_of_logarithms_decides(tmp_path: Path):
    path = save(tmp_path / "a.glb", logs_glb((-3, -2, -1), (2,)))
    with pytest.raises(InputError, match="opacity of Gaussian 0: expected 0 to 1, found 2"):  # bytes, perhaps
        load_splat(path)
    with pytest.raises(InputError, match="expected 0 to 1, found 2"):
        load_splat(path, activated=True)
    splat = load_splat(path, activated=False)
    assert splat.notes == ()
    assert splat.gaussians.colour.scales[0].tolist() == pytest.approx([0.049787, 0.135335, 0.367879], rel=1e-5)
    assert splat.gaussians.opacities[:1].tolist() == pytest.approx([0.880797], rel=1e-5)


def test_a_few_negative_scales_are_refused_also_in_our_own_files(tmp_path: Path):
    """A footprint of 0.01 is within the squares of -3, 2 and 1, whose roots without it would all be positive."""
    arrays = gltf_arrays()
    arrays[f"{SPLAT}:SCALE"] = np.array([[-3, 2, 1]], "<f4")
    for extra in ({}, {"_FOOTPRINT": np.array([[0.01]], "<f4")}):
        with pytest.raises(InputError, match="scale of Gaussian 0: expected finite numbers, 0 or more, found -3"):
            read(tmp_path, glb(*gltf(arrays | extra)))


def test_logarithms_in_our_own_files_contain_the_footprint(tmp_path: Path):
    """exp(-1)^2 = 0.135335; without 0.01, its root is 0.354027."""
    splat = read(tmp_path, logs_glb((-1, -1, -1), (0.25,), footprint=0.01))
    assert splat.gaussians.colour.scales[0].tolist() == pytest.approx([0.354027] * 3, rel=1e-5)
