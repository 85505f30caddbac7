from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from ply import read_ply

from semgs.data.tables.classes import SCANNET20
from semgs.export.ply import save_ply, save_semantic_ply
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.splats.load import load_splat


def some_gaussians(count: int = 7, harmonics: int = 9, seed: int = 3) -> Gaussians:
    draw = torch.Generator().manual_seed(seed)

    def shape(features: torch.Tensor) -> Appearance:
        quaternions = torch.nn.functional.normalize(torch.randn(count, 4, generator=draw), dim=-1)
        return Appearance(quaternions, torch.rand(count, 3, generator=draw) * 0.1 + 1e-3, features)

    return Gaussians(
        means=torch.randn(count, 3, generator=draw) * 4,
        opacities=torch.rand(count, generator=draw),
        colour=shape(torch.randn(count, harmonics, 3, generator=draw) * 0.3),
        semantic=shape(torch.randn(count, 20, generator=draw).softmax(-1)),
    )


@pytest.mark.parametrize("harmonics", [1, 4, 9, 16])
def test_a_file_holds_the_same_gaussians_at_every_degree(tmp_path: Path, harmonics: int) -> None:
    gaussians = some_gaussians(harmonics=harmonics)
    save_ply(tmp_path / "a.ply", gaussians)
    read = read_ply(tmp_path / "a.ply")
    torch.testing.assert_close(read.means, gaussians.means)
    torch.testing.assert_close(read.opacities, gaussians.opacities)
    torch.testing.assert_close(read.colour.quaternions, gaussians.colour.quaternions)
    torch.testing.assert_close(read.colour.scales, gaussians.colour.scales)
    torch.testing.assert_close(read.colour.features[:, :harmonics], gaussians.colour.features)
    assert (read.colour.features[:, harmonics:] == 0).all()
    assert read.semantic is None


def test_the_file_is_the_one_that_viewers_expect_byte_by_byte(tmp_path: Path) -> None:
    harmonics = torch.zeros(1, 4, 3)
    harmonics[0, 0] = torch.tensor([0.1, 0.2, 0.3])
    harmonics[0, 1:, 0] = torch.tensor([1.0, 2.0, 3.0])  # red, of degree 1
    harmonics[0, 1:, 2] = torch.tensor([7.0, 8.0, 9.0])  # blue
    colour = Appearance(torch.tensor([[2.0, 0.0, 0.0, 0.0]]), torch.tensor([[1.0, math.e, math.e**2]]), harmonics)
    save_ply(tmp_path / "a.ply", Gaussians(torch.tensor([[1.0, 2.0, 3.0]]), torch.tensor([0.5]), colour))
    head, _, body = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    lines = head.decode().splitlines()
    assert lines[:3] == ["ply", "format binary_little_endian 1.0", "element vertex 1"]
    names = [line.removeprefix("property float ") for line in lines[3:]]
    row = dict(zip(names, np.frombuffer(body, "<f4").tolist(), strict=True))
    assert names[:9] == ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"]
    assert names[9:54] == [f"f_rest_{i}" for i in range(45)]
    assert names[54:] == ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"]
    assert [row[name] for name in ("x", "y", "z", "nx", "ny", "nz")] == [1, 2, 3, 0, 0, 0]
    assert [row[f"f_dc_{i}"] for i in range(3)] == pytest.approx([0.1, 0.2, 0.3])
    assert [row[f"f_rest_{i}"] for i in (0, 1, 2, 3)] == [1, 2, 3, 0]
    assert [row[f"f_rest_{i}"] for i in (15, 16, 17)] == [0, 0, 0]
    assert [row[f"f_rest_{i}"] for i in (30, 31, 32, 33)] == [7, 8, 9, 0]
    assert row["opacity"] == 0
    assert [row[f"scale_{i}"] for i in range(3)] == pytest.approx([0, 1, 2])
    assert [row[f"rot_{i}"] for i in range(4)] == [1, 0, 0, 0]


def test_solid_empty_and_flat_gaussians_stay_finite(tmp_path: Path) -> None:
    gaussians = some_gaussians(3)
    flat = Appearance(gaussians.colour.quaternions, torch.zeros(3, 3), gaussians.colour.features)
    save_ply(tmp_path / "a.ply", Gaussians(gaussians.means, torch.tensor([0.0, 1.0, 0.25]), flat))
    read = read_ply(tmp_path / "a.ply")
    torch.testing.assert_close(read.opacities, torch.tensor([0.0, 1.0, 0.25]), atol=1e-6, rtol=0)
    assert (read.colour.scales < 1e-15).all()


def test_each_semantic_gaussian_has_its_own_shape_and_the_colour_of_its_likeliest_class(tmp_path: Path) -> None:
    gaussians = some_gaussians(11)
    save_semantic_ply(tmp_path / "a.ply", gaussians, SCANNET20)
    read = read_ply(tmp_path / "a.ply")
    assert gaussians.semantic is not None
    torch.testing.assert_close(read.colour.scales, gaussians.semantic.scales)
    torch.testing.assert_close(read.colour.quaternions, gaussians.semantic.quaternions)
    expected = torch.tensor(SCANNET20.colours)[gaussians.semantic.features.argmax(-1)] / 255
    torch.testing.assert_close(0.5 + 0.28209479177387814 * read.colour.features[:, 0], expected)
    assert (read.colour.features[:, 1:] == 0).all()


def test_what_a_ply_cannot_hold_is_refused(tmp_path: Path) -> None:
    gaussians = some_gaussians(5)
    with pytest.raises(ValueError, match="one scene"):
        save_ply(tmp_path / "a.ply", gaussians.map(lambda tensor: tensor[None]))
    broken = gaussians.means.clone()
    broken[4, 1] = float("nan")
    with pytest.raises(ValueError, match="y of Gaussian 4 is nan"):
        save_ply(tmp_path / "a.ply", Gaussians(broken, gaussians.opacities, gaussians.colour))
    with pytest.raises(ValueError, match="no classes"):
        save_semantic_ply(
            tmp_path / "a.ply", Gaussians(gaussians.means, gaussians.opacities, gaussians.colour), SCANNET20
        )
    assert list(tmp_path.iterdir()) == []


def test_a_scene_without_gaussians_is_a_file_without_rows(tmp_path: Path) -> None:
    save_ply(tmp_path / "a.ply", some_gaussians(0))
    assert len(read_ply(tmp_path / "a.ply")) == 0


def test_gsply_reads_the_same_numbers(tmp_path: Path) -> None:
    gsply = pytest.importorskip("gsply")
    gaussians = some_gaussians(harmonics=9)
    save_ply(tmp_path / "a.ply", gaussians)
    read = gsply.plyread(str(tmp_path / "a.ply"))
    assert np.array_equal(read.means, gaussians.means.numpy())
    assert np.allclose(1 / (1 + np.exp(-read.opacities.ravel())), gaussians.opacities.numpy(), atol=1e-6)
    assert np.allclose(np.exp(read.scales), gaussians.colour.scales.numpy(), rtol=1e-5)
    assert np.allclose(read.quats, gaussians.colour.quaternions.numpy(), atol=1e-6)
    assert np.array_equal(read.sh0, gaussians.colour.features[:, 0].numpy())
    assert np.array_equal(read.shN[:, :8], gaussians.colour.features[:, 1:].numpy())
    assert (read.shN[:, 8:] == 0).all()


def test_further_columns_follow_those_of_3dgs_and_comments_come_before_them(tmp_path: Path) -> None:
    extra = {"label": np.array([4, 255], np.uint8), "confidence": np.array([0.75, 0.05]), "instance": np.array([0, 3])}
    gaussians = some_gaussians(2)
    save_ply(tmp_path / "a.ply", gaussians, extra, ["label 4 chair"])
    save_ply(tmp_path / "plain.ply", gaussians)
    head, _, body = (tmp_path / "a.ply").read_bytes().partition(b"end_header\n")
    lines = head.decode().splitlines()
    assert lines[:4] == ["ply", "format binary_little_endian 1.0", "comment label 4 chair", "element vertex 2"]
    assert lines[-3:] == ["property uchar label", "property float confidence", "property float instance"]
    assert len(body) == 2 * (62 * 4 + 1 + 4 + 4)
    rows = np.frombuffer(
        body, np.dtype([("plain", "<f4", 62), ("label", "u1"), ("confidence", "<f4"), ("instance", "<f4")])
    )
    plain = (tmp_path / "plain.ply").read_bytes().partition(b"end_header\n")[2]
    assert rows["plain"].tobytes() == plain
    assert rows["label"].tolist() == [4, 255]
    assert rows["confidence"].tolist() == [0.75, np.float32(0.05)]
    assert rows["instance"].tolist() == [0, 3]
    for name, values in (("opacity", np.zeros(2)), ("label", np.zeros(3)), ("label", np.zeros((2, 1)))):
        with pytest.raises(ValueError, match=f"{name} is .*; expected a further property with 2 numbers"):
            save_ply(tmp_path / "b.ply", gaussians, {name: values})


def test_a_name_of_two_lines_in_a_comment_leaves_a_file_that_can_be_read(tmp_path: Path) -> None:
    save_ply(tmp_path / "a.ply", some_gaussians(2), comments=["label 4 power\nsocket", "label 5 a\r\nend_header\nb"])
    read = load_splat(tmp_path / "a.ply")
    assert (len(read), read.comments) == (2, ("label 4 power socket", "label 5 a end_header b"))
