import numpy as np
import pytest

from semgs.files.errors import InputError
from semgs.rooms.assets.glb import read_glb


def test_a_mesh_reads_back_as_it_was_written(tmp_path, write_mesh, box_mesh):
    vertices, faces, uv = box_mesh((0.4, 0.7, 1.1))
    nodes = {"n0": (vertices, faces, uv, (0.25, 0.5, 0.125)), "n1": (vertices + 1, faces[:3], uv, (1.0, 0.0, 1.0))}
    write_mesh(tmp_path / "a.glb", nodes, texture=b"picture")
    first, second = read_glb(tmp_path / "a.glb")
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
        with pytest.raises(InputError, match=r"a\.glb"):
            read_glb(tmp_path / "a.glb")


def test_a_node_that_moves_its_mesh_is_refused(tmp_path, write_mesh, box_mesh):
    nodes = {"n0": (*box_mesh((1, 1, 1)), (1.0, 1.0, 1.0))}
    write_mesh(tmp_path / "a.glb", nodes, translation=[0, 0, 1])
    with pytest.raises(InputError, match="transform"):
        read_glb(tmp_path / "a.glb")


def test_a_face_that_names_no_vertex_is_refused(tmp_path, write_mesh, box_mesh):
    vertices, faces, uv = box_mesh((1, 1, 1))
    write_mesh(tmp_path / "a.glb", {"n0": (vertices, faces + 1, uv, (1.0, 1.0, 1.0))})
    with pytest.raises(InputError, match="vertex 24 of 24"):
        read_glb(tmp_path / "a.glb")
