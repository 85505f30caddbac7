import pytest
import torch

from semgs import load, open_scene, render
from semgs.data.demo_scene import demo_scene
from semgs.data.resampling import resized
from semgs.evaluation.frames.protocols import neighbours
from semgs.model.weights.load import shipped
from semgs.model.weights.weights_file import read_header
from semgs.objectives.metrics import confusion_matrix, miou, psnr
from semgs.rendering.rendering import likeliest
from semgs_rooms.sets.dataset import RoomSettings, write_dataset

LARGEST = 12e6
"""What may ship [bytes]."""


@pytest.fixture(scope="module")
def small():
    return load("small").eval()


def test_the_file_is_small_and_says_what_it_is():
    path = shipped("small")
    assert path.stat().st_size <= LARGEST
    header = read_header(path)
    assert header.classes.name == "scannet20"
    assert {"description", "data", "seed", "licence"} <= header.metadata.keys()


UNMET = pytest.mark.xfail(strict=True, reason="a goal not reached yet: see docs/model_card.md")


@pytest.mark.parametrize("name", [pytest.param("hololens_office", marks=UNMET), "fox", "small_house/living"])
def test_context_views_are_drawn_as_they_were_photographed(shared, small, name):
    views = open_scene(shared / "data" / name).read([3, 4], "native")
    height, width = views.size
    views = resized(views, (320, 240) if height > width else (240, 320))
    with torch.inference_mode():
        encoding = small(views)
        rendering = render(encoding.gaussians, views.cameras)
    error = (rendering.images.clamp(0, 1) - views.images).square().mean((1, 2, 3))
    found = -10 * error.log10()
    assert (found >= 22).all(), found.tolist()
    assert torch.allclose(rendering.semantics.sum(1), torch.ones(1), atol=1e-4)


@pytest.mark.long
def test_more_views_draw_held_out_views_no_worse(small, tmp_path):
    """Three and four views, the two among them, against two, over the same targets of the demo and four rooms. In one room alone, classes
    may differ by 0.003 either way."""
    write_dataset(tmp_path / "rooms", RoomSettings(77, (240, 320), 6), 4)
    scenes = [open_scene(path) for path in (demo_scene(), *sorted((tmp_path / "rooms").glob("scene_*")))]
    psnrs: dict[int, float] = {}
    mious: dict[int, float] = {}
    for count in (2, 3, 4):
        ratios, confusion = [], torch.zeros(20, 20, dtype=torch.long)
        for scene in scenes:
            for sample in neighbours(scene, count)[::2]:
                target = resized(scene.read([sample.target], "native"), (240, 320))
                with torch.inference_mode():
                    encoding = small(resized(scene.read(sample.contexts, "native"), (240, 320)))
                    rendering = encoding.render(target.cameras)
                ratios.append(psnr(rendering.images.clamp(0, 1), target.images).item())
                confusion += confusion_matrix(likeliest(rendering.semantics), target.labels, 20)
        psnrs[count], mious[count] = sum(ratios) / len(ratios), miou(confusion).item()
    for count in (3, 4):
        assert psnrs[count] >= psnrs[2], psnrs
        assert mious[count] >= mious[2], mious
