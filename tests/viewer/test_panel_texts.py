from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_viewer_page import data_of
from viser_canvas import canvas_of
from wall_and_chair import wall_and_chair

from semgs.scene.scene_file import SavedScene
from semgs.viewer.panel_texts import controls_of, hit_text, legend_label
from semgs.viewer.pick import Hit
from semgs.viewer.splat_groups import Group
from semgs.viewer.viewer_page import scene_page
from semgs.viewer.window import Window, open_window

LIVE_ONLY = ["Overlay", "Render from here"]


def words_of(window: Window) -> list[str]:
    """The words of viser's panel, from top to bottom; a group of buttons has those of its buttons."""
    messages = window._server._websock_server._broadcast_buffer.message_from_id.values()
    found: list[str] = []
    for props in [getattr(one, "props", None) for one in messages if type(one).__name__.startswith("Gui")]:
        label: Any = getattr(props, "label", None)
        if label is not None:
            found += props.options if label == "" else [label]
    return found


def words_of_page(html: str) -> list[str]:
    """The words that a page gives its panel, in the order of its controls."""
    data = data_of(html)
    found: list[str] = []
    for control in data["controls"]:
        name = control["name"]
        if control["key"] == "photo":
            found += [f"{name} {number + 1}" for number in range(len(data["views"]))]
            continue
        found.append(name)
        if control["key"] == "classes":
            found += [data["words"]["show_all"], data["words"]["hide_all"]]
            found += [f"{entry['name']} {entry['share']}" for entry in data["classes"]]
    return found


@pytest.mark.parametrize("classes", [True, False])
def test_the_viewer_and_a_page_have_the_same_words_in_the_same_order(classes: bool):
    scene = wall_and_chair((4, 5), classes=classes)
    with open_window(scene) as window:
        live = words_of(window)
    page = words_of_page(scene_page(scene).html)
    only_live = [
        *LIVE_ONLY,
        *([] if classes else ["Show"]),
    ]  # a page without classes shows colour alone, so there is no choice
    assert [word for word in live if word not in only_live] == page
    shared = ["Back to the photos", "Photo 1", "Photo 2", "Stay where the photos saw", "Show the photos"]
    legend = ["Classes", "Show all", "Hide all", "wall 60 %", "chair 40 %", "Confidence"]
    assert page == (["Show", *shared, *legend, "Clicked"] if classes else [*shared, "Clicked"])


@pytest.mark.long
def test_a_browser_shows_these_words_in_both(tmp_path):
    scene = wall_and_chair()
    file = tmp_path / "scene.html"
    file.write_text(scene_page(scene).html)
    names = [one.name for one in controls_of(("colour", "classes"), things=False, on_page=True)]
    expected = [one for one in names if one != "Photo"]

    def in_order(text: str) -> list[str]:
        return sorted(expected, key=text.index)

    with canvas_of(file.as_uri(), (720, 960), offline=True) as canvas:
        canvas.page.locator("body[data-ready]").wait_for()
        panel = canvas.page.locator("#semgs-panel")
        text = panel.inner_text()
        assert panel.get_by_role("group", name="Show").count() == 1, "two buttons, which need no heading"
        expected.remove("Show")
        # "Classes" is a button of Show, too; the heading is that after the photos.
        assert in_order(text[text.index("Back to") :]) == expected
    with open_window(scene) as window, canvas_of(window.url, (720, 960)) as canvas:
        canvas.page.get_by_role("button", name="Render from here").wait_for()
        text = canvas.page.locator("body").inner_text()
        assert in_order(text[text.index("Back to") :]) == expected


def test_controls_that_a_scene_does_not_need_are_not_there():
    def keys(*modes, things: bool, on_page: bool) -> list[str]:
        return [one.key for one in controls_of(modes, things=things, on_page=on_page)]

    assert keys("colour", things=False, on_page=True) == ["back", "photo", "near", "photos", "clicked"]
    everything = keys("colour", "classes", "things", things=True, on_page=False)
    assert everything == (
        ["show", "overlay", "back", "photo", "near", "photos", "boxes", "classes", "confidence", "clicked", "render"]
    )


def test_a_class_has_its_share_also_below_1_percent():
    def label(share: float) -> str:
        return legend_label(Group("sink", (1, 2, 3), np.zeros(1, np.int64), share))

    assert label(0.424) == "sink 42 %"
    assert label(0.004) == "sink under 1 %"


def test_a_click_has_class_thing_and_position():
    hit = Hit((1.0, -2.0, 0.5), "chair", 0.8, thing=3)
    assert lines(hit_text(hit, True, {3: "chair 3"})) == [
        "Class: chair, 80 %",
        "Thing: chair 3",
        "Position: 1.00, -2.00, 0.50 m",
    ]
    assert lines(hit_text(replace(hit, thing=0), False, {3: "chair 3"})) == [
        "Class: chair, 80 %",
        "Position: 1, -2, 0.5",
    ]
    assert lines(hit_text(Hit((1.0, 2.0, 3.0), None, None), False)) == ["Position: 1, 2, 3"]
    # Coordinates of a map in an unknown unit, where what is seen is about 2 away: to a thousandth of that.
    far = Hit((500123.4567, -5400000.0001, 100.0), None, None)
    assert lines(hit_text(far, False, decimals=3)) == ["Position: 500123.457, -5400000, 100"]
    assert lines(hit_text(far, False, decimals=0)) == ["Position: 500123, -5400000, 100"]
    assert lines(hit_text(Hit((0.000123, -0.0000001, 0.0), None, None), False, decimals=6)) == [
        "Position: 0.000123, 0, 0"
    ]
    assert lines(hit_text(None, True)) == ["Nothing is shown here: no photo saw it, or its class is hidden."]


def lines(html: str) -> list[str]:
    return html.partition(">")[2].removesuffix("</div>").split("<br>")


@pytest.mark.parametrize("mode", ["Colour", "Classes"])
def test_less_sure_gaussians_are_hidden_from_eyes_and_clicks(mode: str):
    """All are sure to 0.8, in the eighth step; those of 0.55 in the fifth."""
    scene = unsure(wall_and_chair())
    with open_window(scene) as window:
        window._mode_control.value = mode
        for percent, shown in ((0, 4000), (50, 4000), (60, 3200), (80, 3200), (90, 0)):
            window._least_control.value = percent
            window._show_mode()
            assert window._find_visible().sum() == shown
            opaque = np.concatenate([node.opacities for node in window._nodes.values()])
            assert (opaque > 0).sum() == shown


def unsure(scene: SavedScene) -> SavedScene:
    """The last 10 columns of each view, which are 800 Gaussians, have a class of 0.55."""
    assert scene.gaussians.semantic is not None
    features = scene.gaussians.semantic.features.reshape(2, 40, 50, -1)
    features[:, :, 40:] = 0.45 / (features.shape[-1] - 1)
    features[:, :, 40:, 0] = 0.55
    return scene
