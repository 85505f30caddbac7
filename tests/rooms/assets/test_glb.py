import cv2
import numpy as np
import pytest

from semgs.files.errors import InputError
from semgs_rooms.assets.glb import Primitive, read_primitives, write_primitives


def test_a_mesh_reads_back_as_it_was_written(tmp_path, write_mesh, box_mesh):
    vertices, faces, uv = box_mesh((0.4, 0.7, 1.1))
    nodes = {"n0": (vertices, faces, uv, (0.25, 0.5, 0.125)), "n1": (vertices + 1, faces[:3], uv, (1.0, 0.0, 1.0))}
    write_mesh(tmp_path / "a.glb", nodes, texture=b"picture")
    first, second = read_primitives(tmp_path / "a.glb")
    assert (first.name, first.material, first.texture) == ("n0", "m0_paint", b"picture")
    assert first.colour == (0.25, 0.5, 0.125)
    assert not first.clear
    np.testing.assert_array_equal(first.vertices, vertices)
    np.testing.assert_array_equal(first.faces, faces)
    np.testing.assert_array_equal(first.uv, uv)
    np.testing.assert_array_equal(second.vertices, vertices + 1)
    assert len(second.faces) == 3


def test_a_file_that_ends_early_is_refused_by_name(tmp_path, write_mesh, box_mesh):
    write_mesh(tmp_path / "a.glb", {"n0": (*box_mesh((1, 1, 1)), (1.0, 1.0, 1.0))})
    whole = (tmp_path / "a.glb").read_bytes()
    for length in (0, 11, 40, len(whole) // 2, len(whole) - 1):
        (tmp_path / "a.glb").write_bytes(whole[:length])
        with pytest.raises(InputError, match=r"a\.glb: expected .*; fetch it again"):
            read_primitives(tmp_path / "a.glb")


def test_a_node_that_moves_its_mesh_is_refused(tmp_path, write_mesh, box_mesh):
    nodes = {"n0": (*box_mesh((1, 1, 1)), (1.0, 1.0, 1.0))}
    write_mesh(tmp_path / "a.glb", nodes, translation=[0, 0, 1])
    with pytest.raises(InputError, match="transform"):
        read_primitives(tmp_path / "a.glb")


def test_a_face_that_names_no_vertex_is_refused(tmp_path, write_mesh, box_mesh):
    vertices, faces, uv = box_mesh((1, 1, 1))
    write_mesh(tmp_path / "a.glb", {"n0": (vertices, faces + 1, uv, (1.0, 1.0, 1.0))})
    with pytest.raises(InputError, match="vertex 24 of 24"):
        read_primitives(tmp_path / "a.glb")


def test_what_is_written_reads_back(tmp_path):
    """Two materials that share a picture, more vertices than 16 bits count, and one that is to be seen through."""
    rng, png = np.random.default_rng(0), cv2.imencode(".png", np.zeros((2, 3, 3), np.uint8))[1].tobytes()

    def primitive(name, count, texture, clear=False):
        uv = rng.random((count, 2), dtype=np.float32) if texture else np.zeros((count, 2), np.float32)
        faces = rng.integers(0, count, (50, 3))
        vertices = rng.normal(size=(count, 3)).astype(np.float32)
        return Primitive(f"n_{name}", f"m_{name}", vertices, faces, uv, (0.25, 0.5, 1.0), texture, clear)

    written = [primitive("body", 70_000, png), primitive("leg", 9, png), primitive("pane", 5, None, clear=True)]
    write_primitives(tmp_path / "x.glb", written)
    found = read_primitives(tmp_path / "x.glb")
    assert (tmp_path / "x.glb").read_bytes().count(png) == 1
    for one, other in zip(found, written, strict=True):
        for name in ("name", "material", "colour", "texture", "clear"):
            assert getattr(one, name) == getattr(other, name)
        for name in ("vertices", "faces", "uv"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    with pytest.raises(ValueError, match="neither JPEG nor PNG"):
        write_primitives(tmp_path / "y.glb", [primitive("x", 4, b"GIF89a")])
    assert not (tmp_path / "y.glb").exists()
