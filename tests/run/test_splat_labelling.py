"""Labels for a splat of another program: a wall whose classes are known, from true class maps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import torch

from semgs.data.frames import Frame
from semgs.data.maps import InMemory
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.geometry.gaussians import Gaussians
from semgs.model.encode import Network
from semgs.rendering.rendering import UNSEEN
from semgs.run.output.report import Provenance
from semgs.run.output.report_page import report_page
from semgs.run.steps.result import GivenSplat
from semgs.run.steps.splat_labelling import hold_out, label_splat
from semgs.segmenters.labelling import Labelling

GIVEN = GivenSplat("wall.ply", "PLY", 3)
WALL, PICTURE = SCANNET20.index("wall"), SCANNET20.index("picture")


@dataclass(frozen=True)
class TrueMaps:
    """A source that knows the labels of the photos, and which photos were asked for."""

    scene: Scene
    asked: list[str]
    classes: ClassTable = SCANNET20
    title: str = "true maps"
    made_by: None = None

    @property
    def known(self) -> np.ndarray:
        return np.ones(len(self.classes), bool)

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> torch.Tensor:
        self.asked.append(frame.name)
        labels = self.scene.read([frame.name], size).labels
        assert labels is not None
        return torch.nn.functional.one_hot(labels[0].long(), len(self.classes)).permute(2, 0, 1).float()


@pytest.fixture
def scene(wall_scene: Callable[..., Scene]) -> Scene:
    return wall_scene()


@pytest.fixture
def splat(scene: Scene, oracle: Network) -> Gaussians:
    """The Gaussians of the first and the last photo, without classes."""
    given = oracle(scene.read([0, 3])).gaussians
    return Gaussians(given.means, given.opacities, given.colour)


def test_held_out_views_have_the_true_classes_and_the_geometry_is_the_given_one(scene: Scene, splat: Gaussians) -> None:
    source = TrueMaps(scene, [])
    result = label_splat(scene, splat, Labelling(source), GIVEN, [0, 1, 3], [2], up="-y")
    assert source.asked == ["images/00.png", "images/01.png", "images/03.png"]
    assert result.saved.gaussians.means is splat.means
    assert result.saved.gaussians.colour is splat.colour
    assert result.saved.frames == ("images/00.png", "images/01.png", "images/03.png")
    assert result.target is not None
    assert result.target.names == ("images/02.png",)
    labels, truth = result.target.labels[0], result.target.views.labels[0].numpy()
    known = labels != UNSEEN
    assert known.mean() > 0.9
    assert (labels == truth)[known].mean() > 0.97
    assert set(np.unique(labels[known])) == {WALL, PICTURE}
    assert result.target.scores[0].psnr > 20
    assert result.splat == GIVEN
    assert "true maps" in result.saved.model


def test_gaussians_that_no_photo_sees_stay_unseen_and_the_notes_say_how_many(scene: Scene, splat: Gaussians) -> None:
    behind = splat.map(lambda tensor: torch.cat((tensor, tensor[:7])))
    means = behind.means.clone()
    means[-7:] += torch.tensor([0.0, 0.0, 500.0])
    more = Gaussians(means, behind.opacities, behind.colour)
    result = label_splat(scene, more, Labelling(TrueMaps(scene, [])), GIVEN, [0, 1, 3], up="-y")
    assert result.target is None
    assert result.saved.gaussians.semantic is not None
    shares = result.saved.gaussians.semantic.features
    assert shares[-7:].tolist() == [[pytest.approx(0.05)] * 20] * 7
    assert shares[:-7].amax(1).median().item() == pytest.approx(
        1.001 / 1.02, abs=1e-5
    )  # LEAST is added to each of 20 classes
    unseen = int((shares.amax(1) < 0.051).sum())
    assert 7 <= unseen < 0.1 * len(more)
    assert any(note.startswith(f"{unseen} of {len(more):,} Gaussians are outside all photos") for note in result.notes)


def test_the_notes_are_those_of_every_reconstruction_but_for_guessed_depth(scene: Scene, splat: Gaussians) -> None:
    """One photo has no parallax and no overlap, but nobody guessed the depth of a splat."""
    unknown = replace(scene, unit="unknown", notes=())
    result = label_splat(unknown, splat, Labelling(TrueMaps(scene, [])), GIVEN, [0], up="-y")
    assert [note[:40] for note in result.notes if "Gaussians are outside" not in note] == [
        "1 of 1 images have another aspect ratio ",
        "The scale of this scene is unknown, so l",
        "No frame is held out, so the scores do n",
    ]


def test_cameras_that_do_not_fit_are_noticed(scene: Scene, splat: Gaussians) -> None:
    dark = Gaussians(splat.means, splat.opacities, splat.colour.__class__(
        splat.colour.quaternions, splat.colour.scales, -splat.colour.features
    ))  # fmt: skip
    result = label_splat(scene, dark, Labelling(TrueMaps(scene, [])), GIVEN, [0, 3], up="-y")
    assert any("does not look like the photos" in note for note in result.notes)
    fitting = label_splat(scene, splat, Labelling(TrueMaps(scene, [])), GIVEN, [0, 3], up="-y")
    assert not any("does not look like" in note for note in fitting.notes)


def test_the_report_says_whose_geometry_it_is_and_claims_nothing_about_the_training(
    scene: Scene, splat: Gaussians
) -> None:
    result = label_splat(scene, splat, Labelling(TrueMaps(scene, [])), GIVEN, [0, 1, 3], [2], up="-y")
    page = report_page(result, Provenance("semgs 9.9", "", 0, "cpu"), {"segment": 1.0})
    assert "wall.ply, labelled from 3 photos and compared with 1 that was held out." in page
    assert "wall.ply (PLY)" in page
    assert "These photos said no classes." in page
    assert "The model did not get these frames" not in page
    assert "parameters, on" not in page


@pytest.mark.parametrize(
    ("count", "each", "held"), [(8, 8, [4]), (20, 8, [4, 12]), (3, 8, []), (5, 0, []), (4, 2, [1, 3]), (2, 1, [0, 1])]
)
def test_one_of_so_many_photos_is_held_out(count: int, each: int, held: list[int]) -> None:
    assert hold_out(count, each) == ([place for place in range(count) if place not in held], held)


@dataclass(frozen=True)
class OtherBelow(TrueMaps):
    """As `TrueMaps`, but the lower half of each photo is floor."""

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> torch.Tensor:
        maps = super().of(frame, size, fit).clone()
        maps[:, size[0] // 2 :] = torch.eye(len(self.classes))[SCANNET20.index("floor")][:, None, None]
        return maps


def test_pixels_that_a_mask_hides_do_not_vote(scene: Scene, splat: Gaussians) -> None:
    """The lower half of each photo is hidden, and one of two sources says another class there: the labels are the same."""
    hidden = np.zeros(scene.frames[0].lens.size, bool)
    hidden[len(hidden) // 2 :] = True
    masked = replace(scene, frames=tuple(replace(frame, mask=InMemory(hidden)) for frame in scene.frames))
    said, other = (
        label_splat(masked, splat, Labelling(source(scene, [])), GIVEN, [0, 1, 3], up="-y").saved.gaussians.semantic
        for source in (TrueMaps, OtherBelow)
    )
    assert said is not None
    assert other is not None
    assert torch.equal(said.features, other.features)
    seen = said.features.amax(1) > 0.051
    assert 0.3 < seen.double().mean() < 0.7
