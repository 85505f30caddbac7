from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from semgs.data.choosing.choice import choose_named
from semgs.data.scene import Scene
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.figures.view_images import millimetres
from semgs.files.images.pictures import read_rgb, read_uint8, read_uint16
from semgs.model.encode import Network
from semgs.rendering.rendering import label_maps
from semgs.run.output.files import per_thousand, whole_percent, write_renders
from semgs.run.steps.pipeline import reconstruct


def test_each_view_has_its_files_and_they_hold_what_was_rendered(
    wall_scene: Callable[..., Scene], oracle: Network, tmp_path: Path
) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 2]), oracle)
    (tmp_path / "renders").mkdir()
    write_renders(tmp_path / "renders", result)
    written = sorted(path.name for path in (tmp_path / "renders").iterdir())
    both = ["alpha", "classes", "confidence", "depth", "depth_spread", "image", "labels"]
    own, held_out = [*both, "input"], [*both, "truth", "truth_depth", "truth_labels"]
    assert written == sorted(
        [f"context_{position:03d}_{name}.png" for position in (0, 2) for name in own]
        + [f"target_{position:03d}_{name}.png" for position in (1, 3) for name in held_out]
    )
    assert result.target is not None
    rendering = result.encoding.render(result.target.views.cameras)
    folder = tmp_path / "renders"
    image = read_rgb(folder / "target_001_image.png") / 255
    assert np.abs(image - rendering.images[0].clamp(0, 1).permute(1, 2, 0).numpy()).max() < 0.5 / 255 + 1e-6
    depth = read_uint16(folder / "target_001_depth.png") / 1000
    assert np.abs(depth - rendering.depths[0].numpy()).max() < 0.5e-3 + 1e-6
    alpha = read_uint8(folder / "target_001_alpha.png") / 255
    assert np.abs(alpha - rendering.alphas[0].numpy()).max() < 0.5 / 255 + 1e-6
    labels = read_uint8(folder / "target_001_labels.png")
    assert (labels == label_maps(rendering)[0]).all()
    truth = read_uint8(folder / "target_001_truth_labels.png")
    assert (truth == labels).mean() > 0.95
    photo = read_rgb(folder / "target_001_truth.png") / 255
    assert np.abs(photo - result.target.views.images[0].permute(1, 2, 0).numpy()).max() < 0.5 / 255 + 1e-6


def test_without_a_known_unit_depth_is_floating_point_and_no_millimetres_are_written(
    wall_scene: Callable[..., Scene], oracle: Network, tmp_path: Path
) -> None:
    scene = wall_scene(metric=False)
    result = reconstruct(scene, choose_named(scene, [0, 2]), oracle)
    (tmp_path / "renders").mkdir()
    write_renders(tmp_path / "renders", result)
    assert not list((tmp_path / "renders").glob("*depth.png"))
    depth = np.asarray(Image.open(tmp_path / "renders/context_000_depth.tiff"))
    assert depth.dtype == np.float32
    assert (depth == result.context.depths[0].numpy()).all()


def test_labels_in_another_class_table_are_no_true_class_maps_and_a_note_says_so(
    wall_scene: Callable[..., Scene], oracle: Network, tmp_path: Path
) -> None:
    """The same number would mean another class than in the class map beside it."""
    scene = wall_scene()
    own = ClassTable("own", tuple(f"thing {n}" for n in range(20)), SCANNET20.colours, tuple(range(20)))
    for name, opened in (("same", scene), ("other", replace(scene, classes=own))):
        result = reconstruct(opened, choose_named(opened, [0, 2]), oracle)
        assert result.target is not None
        (tmp_path / name).mkdir()
        write_renders(tmp_path / name, result)
        said = "The labels of the scene are in the class table own, and the classes of the Gaussians in scannet20"
        assert any(note.startswith(said) for note in result.notes) == (name == "other")
        assert (result.target.scores[0].miou is None) == (name == "other")
        assert (tmp_path / name / "target_001_truth_labels.png").exists() == (name == "same")
        assert (tmp_path / name / "target_001_truth_depth.png").exists()


def test_a_colour_only_network_leaves_the_class_maps_out(
    wall_scene: Callable[..., Scene], colour_oracle: Network, tmp_path: Path
) -> None:
    scene = wall_scene()
    (tmp_path / "renders").mkdir()
    write_renders(tmp_path / "renders", reconstruct(scene, choose_named(scene, [0, 1]), colour_oracle))
    names = {path.name for path in (tmp_path / "renders").iterdir()}
    assert "context_000_image.png" in names
    assert not any(
        "classes" in name or "confidence" in name or (name.startswith("context") and "labels" in name) for name in names
    )


def test_thresholds_of_the_files_separate_the_pixels_that_the_option_separates(
    wall_scene: Callable[..., Scene], oracle: Network, tmp_path: Path
) -> None:
    scene = wall_scene()
    (tmp_path / "renders").mkdir()
    result = reconstruct(scene, choose_named(scene, [0, 2]), oracle, min_confidence=0.7)
    write_renders(tmp_path / "renders", result)
    stem = "context_000"
    labels, confidence = (read_uint8(tmp_path / f"renders/{stem}_{name}.png") for name in ("labels", "confidence"))
    assert ((labels == 254) == ((confidence > 0) & (confidence < 70))).all()
    assert ((labels == 255) == (confidence == 0)).all()
    assert (
        confidence.max() == 80
    )  # the oracle's 0.81, less the light that passes all Gaussians; lower where both classes mix
    assert 0.01 < (labels == 254).mean() < 0.3
    spread = read_uint16(tmp_path / f"renders/{stem}_depth_spread.png")
    assert ((spread == 65535) == (labels == 255)).all()
    assert 99 <= np.median(spread) <= 103  # the oracle's is 0.1
    assert spread[labels != 255].min() >= 99


def test_shares_are_rounded_down_to_percent_and_spreads_to_the_nearest_thousandth() -> None:
    shares = np.array([[0.0, 0.699, 0.7], [0.7099, 0.8, 1.0]], np.float32)
    assert whole_percent(shares).tolist() == [[0, 69, 70], [70, 80, 100]]
    assert per_thousand(torch.tensor([[0.0, 0.0124, torch.nan], [0.5, 65.0, 70.0]])).tolist() == [
        [0, 12, 65535], [500, 65000, 65535],
    ]  # fmt: skip


def test_depths_that_do_not_fit_into_16_bits_of_millimetres_are_unknown_not_wrong() -> None:
    depths = torch.tensor([[0.0, 0.0004, 0.0006], [1.2344, 65.535, 65.536]])
    assert millimetres(depths).tolist() == [[0, 0, 1], [1234, 65535, 0]]
