"""How sure a network is against how right it is, on small scenes."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from posed import posed_views

from semgs.data.scene import Scene
from semgs.data.tables.classes import IGNORE
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.frames.reading import make_inputs, read_frame, read_views
from semgs.evaluation.scoring.confidence_calibration import collect_statements, measure_temperature
from semgs.model.weights.load import load
from semgs.rendering.render import render

MakeScene = Callable[..., Scene]


@pytest.fixture(scope="module")
def network() -> torch.nn.Module:
    return load("small").eval()


def test_statements_are_what_is_rendered_and_what_each_gaussian_says_at_labelled_pixels(make_scene: MakeScene, network):
    plan = make_plan("neighbours", neighbours, [make_scene("a", frames=3)], [2], size=(32, 48))
    (task,) = plan.tasks
    found = collect_statements(plan, network, pixels=10**6)
    with torch.no_grad():
        inputs = make_inputs(task, read_views(task))
        encoding = network(inputs.contexts)
        rendering = render(encoding.gaussians, inputs.camera, near=float(inputs.contexts.depth_range[0, 0]))
        own = encoding.class_maps()
    truth = read_frame(task, 1, (0.5, 10.0)).labels[0]
    kept = truth != IGNORE
    assert len(found["rendered"].labels) == kept.sum()
    assert sorted(found["rendered"].labels.tolist()) == sorted(truth[kept].tolist())
    expected = rendering.semantics[0].movedim(0, -1)[kept]
    torch.testing.assert_close(found["rendered"].distributions.sum(0), expected.sum(0), rtol=1e-5, atol=1e-4)
    labels = torch.cat([read_frame(task, position, (0.5, 10.0)).labels for position in task.sample.contexts])
    assert len(found["gaussians"].labels) == (labels != IGNORE).sum()
    torch.testing.assert_close(
        found["gaussians"].distributions.sum(0), own.movedim(1, -1)[labels != IGNORE].sum(0), rtol=1e-5, atol=1e-4
    )


def test_some_pixels_of_each_view_are_drawn_by_the_seed_and_scenes_without_labels_say_nothing(
    make_scene: MakeScene, network
):
    scenes = [make_scene("a", frames=3), make_scene("b", frames=3, labels=False)]
    plan = make_plan("neighbours", neighbours, scenes, [2], size=(32, 48))
    once, again, other = (collect_statements(plan, network, pixels=50, seed=seed) for seed in (1, 1, 2))
    assert (len(once["rendered"].labels), len(once["gaussians"].labels)) == (50, 100)
    for kind in once:
        assert torch.equal(once[kind].distributions, again[kind].distributions)
        assert not torch.equal(once[kind].labels, other[kind].labels)


def test_a_fitted_temperature_does_not_raise_the_cost_and_a_given_one_is_kept(make_scene: MakeScene):
    network = load("small")
    network.semantic.mosaic = None  # a mean of two networks is less sure
    plan = make_plan("neighbours", neighbours, [make_scene("a", frames=4)], [2], size=(32, 48))
    said = collect_statements(plan, network)["rendered"]
    fitted = measure_temperature(said)
    assert measure_temperature(said, 1.0).error_after == pytest.approx(fitted.error_before, abs=1e-6)
    # Labels here are noise that the network cannot know, so that it is too sure of itself.
    assert fitted.temperature > 1
    assert fitted.error_after < fitted.error_before
    assert measure_temperature(said, 3.0).temperature == 3.0


def test_what_classify_says_of_each_pixel_is_what_its_gaussian_says_until_views_agree(network, monkeypatch):
    """In sizes that Gaussians of 2x2 pixels do not fill."""
    views = posed_views(3, (33, 51))
    monkeypatch.setattr(network, "fuses", False)
    with torch.no_grad():
        own = network(views).class_maps()
        torch.testing.assert_close(own, network.classify(views), rtol=1e-5, atol=1e-6)
