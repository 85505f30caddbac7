from pathlib import Path

import numpy as np

from semgs.data.ply_tables import write_ply

COLUMNS = {"x": np.array([0.5, -2.0]), "red": np.array([255, 7], np.uint8)}
HEAD = b"ply\nformat %s 1.0\n%selement vertex 2\nproperty float x\nproperty uchar red\n"


def test_rows_are_packed_and_triangles_follow_them(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", COLUMNS, ["by\nhand"], faces=np.array([[0, 1, 258]]))
    head = (
        HEAD % (b"binary_little_endian", b"comment by hand\n")
        + b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    # 0.5 is 0x3f000000 and -2 is 0xc0000000; 258 is 0x0102.
    rows = b"\0\0\0\x3f\xff" + b"\0\0\0\xc0\x07"
    assert (tmp_path / "a.ply").read_bytes() == head + rows + b"\3" + b"\0\0\0\0" + b"\1\0\0\0" + b"\2\1\0\0"


def test_text_has_nine_digits(tmp_path: Path) -> None:
    write_ply(tmp_path / "a.ply", COLUMNS | {"x": np.array([1 / 3, 1234567890.0])}, text=True)
    assert (tmp_path / "a.ply").read_bytes() == HEAD % (
        b"ascii",
        b"",
    ) + b"end_header\n0.333333333 255\n1.23456789e+09 7\n"
