"""What an evaluation does between encoding and rendering."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from mapping_walls import KnowsTheWall, cameras_at, encoded, image
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.tables.class_files import class_file
from semgs.data.tables.classes import SCANNET20
from semgs.data.views import Views
from semgs.depth_maps.depth_source import FrameMaps
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.network_method import Handling, NetworkMethod
from semgs.evaluation.frames.predictions import Inputs
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.frames.reading import make_inputs, read_views
from semgs.files.atomic import write_json
from semgs.files.images.pictures import write_png
from semgs.geometry.harmonics import basis
from semgs.scene.encoding import Encoding
from semgs.scene.exposure import ExposureChoice
from semgs.segmenters.class_map_files import MapFiles
from semgs.segmenters.labelling import Labelling

SIZE = (24, 36)


class TakesColours(KnowsTheWall):
    """As `KnowsTheWall`, with the colours of the photos."""

    def __call__(self, views: Views) -> Encoding:
        encoding = super().__call__(views)
        colours = views.images.movedim(1, -1).reshape(-1, 1, 3)
        colour = replace(encoding.gaussians.colour, features=(colours - 0.5) / basis(torch.zeros(3), 0))
        return replace(encoding, gaussians=replace(encoding.gaussians, colour=colour))


def test_input_views_come_to_a_common_exposure_if_asked(make_scene: Callable[..., Scene]) -> None:
    """Photos 0.8 c and 0.45 c come to 0.6 c, with gains of 3/4 and 4/3."""
    task = make_plan("neighbours", neighbours, (make_scene(),), (2,), None).tasks[0]

    def rendered(brightness: tuple[float, float], exposure: ExposureChoice) -> Tensor:
        """A third view of a wall between two photos of these exposures."""
        images = torch.stack([image(one, SIZE) for one in brightness])
        contexts = Views(images, cameras_at(0.0, 0.0, size=SIZE), [[0.5, 10.0]] * 2)
        inputs = Inputs(task, contexts, cameras_at(0.1, size=SIZE))
        found = NetworkMethod(TakesColours(), "cpu", "wall", Handling(exposure=exposure)).predict(inputs).image
        assert found is not None
        return found

    even, common = rendered((0.6, 0.6), "as-taken"), rendered((0.8, 0.45), "fitted")
    torch.testing.assert_close(common, even, atol=1e-5, rtol=0)
    torch.testing.assert_close(rendered((0.8, 0.45), "auto"), common, atol=0, rtol=0)
    assert not torch.allclose(rendered((0.8, 0.45), "as-taken"), even, atol=0.01)


def test_maps_from_elsewhere_are_stretched_as_the_photos_are(make_scene: Callable[..., Scene], tmp_path: Path) -> None:
    """Photos of 24x96 are compared at 24x48. Class 4 is in their first 24 columns: in 12 of 48, and in none of the middle half, which a crop keeps."""
    scene = make_scene(size=(24, 96))
    (tmp_path / "maps").mkdir()
    columns = np.where(np.arange(96) < 24, 4, 7).astype(np.uint8)
    for frame in scene.frames:
        write_png(tmp_path / "maps" / f"{Path(frame.name).stem}.png", np.tile(columns, (24, 1)))
    write_json(tmp_path / "maps/classes.json", class_file(SCANNET20))
    (task, *_) = make_plan("neighbours", neighbours, (scene,), (2,), (24, 48)).tasks
    views = read_views(task)
    read: dict[str, list[Tensor]] = {"classes": [], "depth": []}

    class Flat(KnowsTheWall):
        def __call__(self, views: Views) -> Encoding:
            return encoded(views.cameras, torch.full((len(views), *views.size), 2.0))

    class Classes(Labelling):
        def __call__(self, *arguments: Any) -> Encoding:
            labelled = super().__call__(*arguments)
            read["classes"] += labelled.class_maps().argmax(1)
            return labelled

    class Depth:
        title, made_by, meaning = "maps", None, "scaled"

        def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Tensor:
            read["depth"].append(FrameMaps().of(frame, size, fit))
            return read["depth"][-1]

    labelling = Classes(MapFiles.opened(tmp_path / "maps", scene), fusion=False)
    NetworkMethod(Flat(), "cpu", "flat", Handling(lambda scene: labelling, depth=lambda scene: Depth())).predict(  # type: ignore[arg-type, return-value]
        make_inputs(task, views)
    )
    assert torch.equal(torch.stack(read["classes"]), torch.where(torch.arange(48) < 12, 4, 7).expand(2, 24, 48))
    for position, found in zip(task.sample.contexts, read["depth"], strict=True):
        true = views[position].depths
        assert true is not None
        assert torch.equal(found, true[0])
