from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.temperatures import Temperatures
from semgs.scene.scene_file import FILE_NAME, SavedScene, load_scene, save_scene


def some_scene(classes: bool = True) -> SavedScene:
    """Two views of 3x4 pixels, each of 2x2 blocks with a Gaussian."""
    draw = torch.Generator().manual_seed(5)

    def shape(features: torch.Tensor) -> Appearance:
        quaternions = torch.nn.functional.normalize(torch.randn(8, 4, generator=draw), dim=-1)
        return Appearance(quaternions, torch.rand(8, 3, generator=draw), features)

    poses = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    poses[:, :3, 3] = torch.tensor([[0.1, 0.2, 0.3], [0.4, 1 / 3, 1e3]], dtype=torch.float64)
    return SavedScene(
        gaussians=Gaussians(
            means=torch.randn(8, 3, generator=draw),
            opacities=torch.rand(8, generator=draw),
            colour=shape(torch.randn(8, 4, 3, generator=draw)),
            semantic=shape(torch.randn(8, 20, generator=draw).softmax(-1)) if classes else None,
        ),
        cameras=Cameras(poses, torch.tensor([[5.0, 0, 2.2], [0, 6, 1.3], [0, 0, 1]]).expand(2, 3, 3), (3, 4)),
        depths=torch.rand(2, 3, 4, generator=draw) + 1,
        confidences=torch.rand(2, 3, 4, generator=draw),
        depth_range=torch.tensor([[0.7, 9.0], [0.5, 8.0]], dtype=torch.float64),
        unit="metric",
        classes=SCANNET20 if classes else None,
        frames=("a.jpg", "grün.jpg"),
        source="office",
        model="small",
        applied_transform=((1.0, 0.0, 0.0, 0.5), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0)),
        applied_scale=0.25,
        temperatures=Temperatures(0.8, 1.1) if classes else None,
        stride=2,
    )


def flat(value: object) -> list[object]:
    if dataclasses.is_dataclass(value):
        return [part for field in dataclasses.fields(value) for part in flat(getattr(value, field.name))]
    return [value.tolist() if isinstance(value, torch.Tensor) else value]


@pytest.mark.parametrize("classes", [True, False])
def test_a_scene_comes_back_as_it_was_from_its_file_or_folder(tmp_path: Path, classes: bool) -> None:
    scene = some_scene(classes)
    save_scene(tmp_path / FILE_NAME, scene)
    for path in (tmp_path, tmp_path / FILE_NAME, str(tmp_path)):
        assert flat(load_scene(path)) == flat(scene)
    assert load_scene(tmp_path).near == 0.5


def test_which_blocks_have_a_gaussian_comes_back(tmp_path: Path) -> None:
    """Of 2x2 blocks in each view the second view's first one has none: the Gaussians of the second view are numbers 4 to 6."""
    places = torch.tensor([0, 1, 2, 3, 5, 6, 7])
    whole = some_scene()
    scene = dataclasses.replace(whole, gaussians=whole.gaussians.map(lambda tensor: tensor[places]), places=places)
    save_scene(tmp_path / "a", scene)
    again = load_scene(tmp_path / "a")
    assert flat(again) == flat(scene)
    assert again.own_views.tolist() == [0, 0, 0, 0, 1, 1, 1]


def test_equal_scenes_give_equal_bytes(tmp_path: Path) -> None:
    save_scene(tmp_path / "a", some_scene())
    save_scene(tmp_path / "b", some_scene())
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_file_cut_anywhere_is_refused_in_one_line(tmp_path: Path) -> None:
    save_scene(tmp_path / "whole", some_scene())
    whole = (tmp_path / "whole").read_bytes()
    for length in (0, 4, 8, 100, len(whole) // 2, len(whole) - 1):
        (tmp_path / "part").write_bytes(whole[:length])
        with pytest.raises(InputError, match="complete scene file") as caught:
            load_scene(tmp_path / "part")
        assert "\n" not in str(caught.value)


def test_files_that_are_not_scenes_are_refused(tmp_path: Path) -> None:
    save_file({"a": torch.zeros(1)}, tmp_path / "weights.safetensors")
    with pytest.raises(InputError, match="another safetensors file"):
        load_scene(tmp_path / "weights.safetensors")
    (tmp_path / "text").write_text("not a scene, but long enough to look at")
    with pytest.raises(InputError):
        load_scene(tmp_path / "text")
    with pytest.raises(InputError, match="no such file"):
        load_scene(tmp_path)
    with pytest.raises(InputError, match="no such file"):
        load_scene(tmp_path / "absent")


def test_another_version_and_missing_or_wrong_parts_are_named(tmp_path: Path) -> None:
    def write(header: dict, tensors: dict) -> Path:
        save_file(tensors, tmp_path / "a", metadata={"semgs": json.dumps(header)})
        return tmp_path / "a"

    for version, advice in (
        (9, "upgrade semgs"),
        (2, "make it again with `semgs reconstruct --out`"),
        (1, "make it again"),
    ):
        told = f"expected version 3, found version {version}; {advice}"
        with pytest.raises(InputError, match=told):
            load_scene(write({"format": "semgs.scene", "version": version}, {"a": torch.zeros(1)}))
    with pytest.raises(InputError, match="a scene file with classes"):
        load_scene(write({"format": "semgs.scene", "version": 3}, {"a": torch.zeros(1)}))
    save_scene(tmp_path / "b", some_scene())
    with safe_open(tmp_path / "b", framework="pt") as file:
        header = json.loads(file.metadata()["semgs"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    with pytest.raises(InputError, match="a scene file with means"):
        load_scene(write(header, {name: tensor for name, tensor in tensors.items() if name != "means"}))
    with pytest.raises(InputError, match="opacities"):
        load_scene(write(header, tensors | {"opacities": tensors["opacities"][:-1]}))
    with pytest.raises(InputError, match="expected torch"):
        load_scene(write(header, tensors | {"means": tensors["means"].double()}))
    with pytest.raises(InputError, match="not finite"):
        load_scene(write(header, tensors | {"cameras.world_from_camera": torch.full((2, 4, 4), float("nan")).double()}))
    with pytest.raises(InputError, match="depths"):
        load_scene(write(header | {"image_size": [4, 3]}, tensors))
    with pytest.raises(InputError, match="there are 8 Gaussians for 24 blocks of pixels"):
        load_scene(write(header | {"stride": 1}, tensors))
    with pytest.raises(InputError, match="stride is 4; expected 1 to 3 pixels"):
        load_scene(write(header | {"stride": 4}, tensors))
    for wrong in (
        [1.0, 2.0],
        {"rendered": 1.0},
        {"rendered": 0.0, "gaussians": 1.0},
        {"rendered": "1", "gaussians": 1.0},
    ):
        with pytest.raises(InputError, match="a valid scene"):
            load_scene(write(header | {"temperatures": wrong}, tensors))
    del header["temperatures"]
    assert load_scene(write(header, tensors)).temperatures is None


def test_a_scene_whose_parts_disagree_cannot_be_made() -> None:
    scene = some_scene()
    with pytest.raises(ValueError, match="cameras are \\(2,\\); expected \\(1,\\)"):
        dataclasses.replace(scene, frames=scene.frames[:1])
    with pytest.raises(ValueError, match="20 classes and the table is None"):
        dataclasses.replace(scene, classes=None)


def test_numbers_that_are_not_finite_are_not_written(tmp_path: Path) -> None:
    scene = some_scene()
    means = scene.gaussians.means.clone()
    means[2, 2] = float("inf")
    with pytest.raises(ValueError, match="means contain a number that is not finite"):
        save_scene(
            tmp_path / "a", dataclasses.replace(scene, gaussians=dataclasses.replace(scene.gaussians, means=means))
        )
    assert list(tmp_path.iterdir()) == []


def test_what_would_not_have_been_written_is_not_read(tmp_path: Path) -> None:
    save_scene(tmp_path / "a", some_scene())
    with safe_open(tmp_path / "a", framework="pt") as file:
        header = file.metadata()
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    for name, index, value, told in (
        ("means", (2, 1), float("nan"), "means contain a number that is not finite"),
        ("opacities", (3,), 7.0, r"opacities contain 7\.0; expected 0 to 1"),
        ("colour.scales", (0, 2), -1.0, r"colour\.scales contain -1\.0; expected 0 or more"),
        ("semantic.scales", (0, 2), float("inf"), r"semantic\.scales contain a number that is not finite"),
        (
            "colour.quaternions",
            (5,),
            0.0,
            r"colour\.quaternions contain \[0\.0, 0\.0, 0\.0, 0\.0\]; expected a length of 1",
        ),
        ("semantic.quaternions", (5,), 2.0, r"expected a length of 1"),
        ("depth_range", (0, 0), -0.7, "depth_range contain an invalid number; expected 0 < near < far"),
        ("depth_range", (1, 1), 0.5, "expected 0 < near < far"),
        ("depths", (0, 1, 1), -1.0, "depths contain"),
        ("confidences", (0, 1, 1), float("nan"), "confidences contain"),
    ):
        changed = tensors[name].clone()
        changed[index] = value
        save_file(tensors | {name: changed}, tmp_path / "b", metadata=header)
        with pytest.raises(InputError, match=told):
            load_scene(tmp_path / "b")


def test_a_header_that_says_a_thing_twice_is_refused(tmp_path: Path) -> None:
    save_scene(tmp_path / "a", some_scene())
    with safe_open(tmp_path / "a", framework="pt") as file:
        text = file.metadata()["semgs"]
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    save_file(
        tensors,
        tmp_path / "b",
        metadata={"semgs": text.replace('"unit": "metric"', '"unit": "unknown", "unit": "metric"')},
    )
    with pytest.raises(InputError, match="the key 'unit' twice in one object"):
        load_scene(tmp_path / "b")
    far = json.dumps(json.loads(text) | {"origin": [1e6, float("inf"), 0]})
    save_file(tensors, tmp_path / "b", metadata={"semgs": far})
    with pytest.raises(InputError):
        load_scene(tmp_path / "b")


def test_a_far_scene_comes_back_as_it_was(tmp_path: Path) -> None:
    scene = dataclasses.replace(some_scene(), origin=(4e6, -5e5, 3e3))
    save_scene(tmp_path / "a", scene)
    again = load_scene(tmp_path / "a")
    assert again.origin == (4e6, -5e5, 3e3)
    torch.testing.assert_close(again.cameras.world_from_camera, scene.cameras.world_from_camera, rtol=0, atol=1e-9)
    with safe_open(tmp_path / "a", framework="pt") as file:
        assert file.get_tensor("cameras.world_from_camera")[0, :3, 3].tolist() == [4000000.1, -499999.8, 3000.3]
