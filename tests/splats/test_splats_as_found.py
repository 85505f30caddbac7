"""Splats as trainings and exporters leave them: broken Gaussians, activated numbers, colours as bytes, and kinds that are not read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pytest
import torch
from splat_files import columns_3dgs, glb, gltf, gltf_arrays, known_row, ply, save

from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.scene.scene_file import load_scene
from semgs.splats.endings import is_splat
from semgs.splats.load import load_splat
from semgs.splats.splat import Splat

LOG = float(np.log(0.04))
COUNT = 125
SIDE = 0.1
"""Gaussians on a grid of 5 x 5 x 5, 10 cm apart."""
GRID = SIDE * np.stack(np.meshgrid(*[np.arange(5.0)] * 3), -1).reshape(-1, 3)


def cloud(path: Path, scale: float = LOG, logit: float = -1.0, **changed: Mapping[int, float]) -> Path:
    """A PLY of the grid, in which `changed` has numbers of some Gaussians by the name of the property."""
    rows = [
        known_row(0, x=x, y=y, z=z, opacity=logit + index / 1000, scale_0=scale, scale_1=scale / 2 if scale > 0 else 2 * scale, scale_2=scale)
        for index, (x, y, z) in enumerate(GRID.tolist())
    ]  # fmt: skip
    for name, numbers in changed.items():
        for index, number in numbers.items():
            rows[index][name] = number
    return save(path, ply({"vertex": columns_3dgs(rows)}))


LENGTHS = "Scales look like lengths"
SHARES = "Opacities look like 0 to 1"


@pytest.mark.parametrize(
    "changed",
    [
        {"x": {7: np.nan}},
        {"scale_1": {7: np.inf}},
        {"f_dc_2": {7: -np.inf}},
        {"rot_0": {7: 0.0}, "rot_1": {7: 0.0}, "rot_2": {7: 0.0}, "rot_3": {7: 0.0}},
        {"opacity": {7: np.nan}, "y": {7: np.nan}},
    ],
)
def test_one_broken_gaussian_of_125_is_left_out_and_counted(tmp_path: Path, changed: dict[str, dict[int, float]]):
    splat = load_splat(cloud(tmp_path / "a.ply", **changed))
    assert splat.notes == splat.comments == (
        "1 of 125 Gaussians are left out: they have a number that is not finite or not valid.",
    )  # fmt: skip
    torch.testing.assert_close(splat.gaussians.means.numpy(), np.delete(GRID, 7, 0).astype(np.float32))


def test_columns_of_ones_own_lose_the_row_too(tmp_path: Path):
    path = cloud(tmp_path / "a.ply", x={3: np.nan}, instance={index: float(index) for index in range(COUNT)})
    assert load_splat(path).extra["instance"].tolist() == [index for index in range(COUNT) if index != 3]


def test_more_than_two_percent_of_broken_gaussians_are_damage(tmp_path: Path):
    """2 of 125 are 1.6 %, 3 are 2.4 %."""
    assert len(load_splat(cloud(tmp_path / "a.ply", x={1: np.nan, 2: np.nan}))) == 123
    with pytest.raises(InputError, match="position of Gaussian 1: expected finite numbers"):
        load_splat(cloud(tmp_path / "a.ply", x={1: np.nan, 2: np.nan, 3: np.nan}))


def test_a_broken_gaussian_of_a_gltf_is_left_out_where_a_node_moves_it(tmp_path: Path):
    arrays = {name: np.repeat(values[:1], COUNT, axis=0) for name, values in gltf_arrays(0).items()}
    arrays["POSITION"] = arrays["POSITION"].copy()
    arrays["POSITION"][5] = np.nan
    splat = load_splat(save(tmp_path / "a.glb", glb(*gltf(arrays, {"translation": [0, 0, 2]}))))
    assert len(splat) == 124
    assert splat.notes[0].startswith("1 of 125 Gaussians are left out")


def scales_and_opacity(splat: Splat) -> list[float]:
    """Of the first Gaussian."""
    gaussians = splat.gaussians
    return [*gaussians.colour.scales[0, :2].tolist(), float(gaussians.opacities[0])]


@pytest.mark.parametrize(
    ("scale", "opacity", "expected", "said"),
    [
        (LOG, -1.0, [0.04, 0.0016, 0.26894142], []),  # as the format says
        (0.04, 0.6, [0.04, 0.02, 0.6], [LENGTHS, SHARES]),
        (0.04, -1.0, [0.04, 0.02, 0.26894142], [LENGTHS]),
        (LOG, 0.6, [0.04, 0.0016, 0.6], [SHARES]),
    ],
)
def test_scales_and_opacities_after_their_activation_are_recognised(
    tmp_path: Path, scale: float, opacity: float, expected: list[float], said: list[str]
):
    """The logarithm of 0.04 doubled is that of 0.0016; the logit -1 is 0.269."""
    splat = load_splat(cloud(tmp_path / "a.ply", scale, opacity))
    assert scales_and_opacity(splat) == pytest.approx(expected, rel=1e-5)
    assert [note[: len(words)] for note, words in zip(splat.notes, said, strict=True)] == said


def test_a_sparse_cloud_of_lengths_is_recognised(tmp_path: Path):
    """Neighbours are 0.4 apart, and Gaussians of 0.04 small against that; their exponentials, 1.04, would be large."""
    rows = [
        known_row(0, x=4 * x, y=4 * y, z=4 * z, opacity=-1.0, scale_0=0.04, scale_1=0.04, scale_2=0.04) for x, y, z in GRID.tolist()
    ]  # fmt: skip
    splat = load_splat(save(tmp_path / "a.ply", ply({"vertex": columns_3dgs(rows)})))
    assert splat.gaussians.colour.scales[0].tolist() == pytest.approx([0.04] * 3)
    assert splat.notes[0].startswith(LENGTHS)


def test_what_the_user_says_decides(tmp_path: Path):
    path = cloud(tmp_path / "a.ply", 0.04, 0.6)
    assert load_splat(path, activated=True).notes == load_splat(path, activated=False).notes == ()
    assert scales_and_opacity(load_splat(path, activated=True)) == pytest.approx([0.04, 0.02, 0.6], rel=1e-5)
    logs = [float(np.exp(0.04)), float(np.exp(0.02)), 1 / (1 + np.exp(-0.6))]
    assert scales_and_opacity(load_splat(path, activated=False)) == pytest.approx(logs, rel=1e-5)


def test_logarithms_of_millimetres_are_no_lengths(tmp_path: Path):
    """Neighbours are 100 mm apart; Gaussians of 40 mm have the logarithm 3.7, which is positive."""
    rows = [
        known_row(0, x=1000 * x, y=1000 * y, z=1000 * z, opacity=-1.0, **dict.fromkeys(("scale_0", "scale_1", "scale_2"), float(np.log(40))))
        for x, y, z in GRID.tolist()
    ]  # fmt: skip
    splat = load_splat(save(tmp_path / "a.ply", ply({"vertex": columns_3dgs(rows)})))
    assert splat.notes == ()
    assert splat.gaussians.colour.scales[0].tolist() == pytest.approx([40] * 3, rel=1e-5)


def test_colours_of_nerfstudio_as_bytes_are_read(tmp_path: Path):
    """A byte of 255 is the colour 1: the coefficient 0.5 / Y_00 = 1.7725; 51 is 0.2: -0.3 / Y_00."""
    columns = columns_3dgs([known_row(0), known_row(0)])
    for name in ("f_dc_0", "f_dc_1", "f_dc_2"):
        del columns[name]
    columns |= {"red": ("uchar", [255, 0]), "green": ("uchar", [51, 0]), "blue": ("uchar", [0, 0])}
    splat = load_splat(save(tmp_path / "a.ply", ply({"vertex": columns})))
    assert splat.gaussians.colour.features[0, 0].tolist() == pytest.approx([1.77245385, -1.06347231, -1.77245385])
    assert not splat.extra


def test_a_ply_without_colours_or_of_flat_gaussians_says_what_to_do(tmp_path: Path):
    columns = columns_3dgs([known_row(0)])
    flat = {name: column for name, column in columns.items() if name != "scale_2"}
    plain = {name: column for name, column in columns.items() if not name.startswith("f_dc")}
    floats = plain | dict.fromkeys(("red", "green", "blue"), ("float", [0.5]))
    anchors = plain | dict.fromkeys(("f_offset_0", "f_anchor_feat_0"), ("float", [0.5]))
    for made, said in (
        (flat, r"2D Gaussians \(2DGS\) are flat"),
        (floats, "; export colours as harmonics: ns-export gaussian-splat --ply-color-mode sh_coeffs$"),
        (plain, "; it has Gaussians without colours: export them as harmonics with the program that trained it$"),
        (
            anchors,
            r"; it has anchors \(Scaffold-GS, Octree-GS and the like\), whose Gaussians come from networks: export these with the ",
        ),
    ):
        with pytest.raises(InputError, match=said):
            load_splat(save(tmp_path / "a.ply", ply({"vertex": made})))


@pytest.mark.parametrize(("ending", "kind"), [("sog", "SOG"), ("ksplat", "KSPLAT"), ("splat", r"\.splat")])
def test_kinds_that_are_not_read_are_named_with_what_converts_them(tmp_path: Path, ending: str, kind: str):
    path = tmp_path / f"office.{ending}"
    with ZipFile(path, "w") as file:
        file.writestr("meta.json", "{}")
    assert is_splat(path)
    with pytest.raises(
        InputError, match=rf"found {kind}; convert it first: splat-transform office.{ending} office.ply"
    ):
        load_splat(path)


@pytest.mark.parametrize("ending", [".pt", ".pth", ".ckpt", ".PT"])
def test_the_checkpoint_of_a_training_is_named_and_not_unpickled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ending: str
):
    path = tmp_path / f"ckpt_29999_rank0{ending}"
    torch.save({"step": 29999, "splats": {"means": torch.zeros(3, 3)}}, path)
    monkeypatch.setattr(torch, "load", lambda *_, **__: pytest.fail("unpickled"))
    told = r"a training checkpoint; export a PLY with the program that trained it \(nerfstudio: ns-export gaussian-splat; gsplat: export_splats\)$"
    for load, expected in ((load_splat, "a splat: PLY"), (load_scene, "a scene file or a splat, ")):
        with pytest.raises(InputError, match=f"expected {expected}.*found {told}"):
            load(path)


def test_the_folder_of_a_training_leads_to_its_last_splat(tmp_path: Path):
    for step in (7000, 30000, 500):
        (tmp_path / f"point_cloud/iteration_{step}").mkdir(parents=True)
        cloud(tmp_path / f"point_cloud/iteration_{step}/point_cloud.ply")
    assert is_splat(tmp_path)
    with pytest.raises(InputError, match=r"the splat of this training is .*iteration_30000/point_cloud.ply"):
        load_splat(tmp_path)
    with pytest.raises(InputError, match=r"3DGS training wrote; .* its splat .*iteration_30000/point_cloud.ply"):
        open_scene(tmp_path)
