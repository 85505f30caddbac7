from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace

import pytest

from semgs.data.choosing.choice import choose_named
from semgs.data.scene import Scene
from semgs.data.tables.classes import ClassTable
from semgs.model.encode import Network
from semgs.objectives.metrics import ViewScores, mean_scores
from semgs.rendering.temperatures import Temperatures
from semgs.run.output.report import Provenance, outputs, report_numbers, rounded
from semgs.run.output.report_page import report_page
from semgs.run.output.score_table import score_lines, score_table
from semgs.run.steps.pipeline import reconstruct

ORIGIN = Provenance("semgs 9.9", "drawn from a hat", 1234567, "cpu")
SECONDS = {"read": 0.25, "encode": 1.5, "render": 0.125}


def text_of(html: str) -> str:
    return " ".join(re.sub(r"<[^>]*>", " ", re.sub(r"<(style|script)>.*?</\1>", "", html, flags=re.DOTALL)).split())


def test_the_numbers_are_those_of_the_result(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    numbers = json.loads(json.dumps(report_numbers(result, ORIGIN, SECONDS), allow_nan=False))
    assert numbers["scene"]["unit"] == "metric"
    assert numbers["choice"]["context"] == [0, 3]
    assert numbers["choice"]["targets"] == [1, 2]
    assert [view["role"] for view in numbers["views"]] == ["context", "context", "target", "target"]
    assert numbers["size"] == {"height": 32, "width": 48}
    assert numbers["native_size"] == {"height": 40, "width": 56}
    assert numbers["gaussians"] == 2 * 32 * 48
    assert numbers["seconds"] == SECONDS
    assert numbers["model"]["parameters"] == 1234567
    assert {entry["name"] for entry in numbers["classes"]} == {"wall", "picture"}
    assert result.target is not None
    held_out = [score.psnr for score in result.target.scores]
    assert numbers["means"]["target"]["psnr"] == pytest.approx(sum(held_out) / 2, rel=1e-4)
    assert numbers["views"][2]["psnr"] == pytest.approx(held_out[0], rel=1e-4)
    assert 0 <= numbers["unseen"] < 0.05
    assert (numbers["min_confidence"], numbers["unknown"], numbers["temperatures"]) == (0, 0, None)
    assert [view["unknown"] for view in numbers["views"]] == [0] * 4
    assert [view["mean_confidence"] for view in numbers["views"]] == pytest.approx([0.8] * 4, abs=0.03)
    assert [view["median_depth_spread"] for view in numbers["views"]] == pytest.approx([0.1] * 4, abs=0.01)


def test_unknown_is_not_unseen_and_the_report_has_the_share_of_both(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    """With a temperature of 4 the oracle's 0.81 becomes 3 / (3 + 19) of 20 classes, 0.136, because 0.81 / 0.01 is 3^4."""
    scene = wall_scene()
    usual, choice = oracle.forward, choose_named(scene, [0, 3])
    oracle.forward = lambda views: replace(usual(views), temperatures=Temperatures(rendered=4.0, gaussians=1.0))
    for threshold, unknown in ((0.13, 0.0), (0.14, 1.0)):
        result = reconstruct(scene, choice, oracle, min_confidence=threshold)
        numbers = report_numbers(result, ORIGIN, SECONDS)
        assert numbers["unknown"] == pytest.approx(unknown, abs=0.05)
        assert numbers["unknown"] + numbers["unseen"] <= 1
        assert numbers["temperatures"] == {"rendered": 4.0, "gaussians": 1.0}
        assert numbers["views"][0]["mean_confidence"] == pytest.approx(3 / 22, abs=0.01)
        assert numbers["means"] == report_numbers(reconstruct(scene, choice, oracle), ORIGIN, SECONDS)["means"]
    text = text_of(report_page(result, ORIGIN, SECONDS))
    assert "Light grey: unknown (seen, but no class has a confidence of 14 %)" in text
    assert "calibrated with the temperatures 4.000 (pixels) and 1.000 (Gaussians)" in text
    share = text.index("% unknown")
    assert 95 <= int(text[:share].split()[-1]) <= 100
    assert "unknown 9" in text or "unknown 100 %" in text  # the legend


def test_a_least_confidence_needs_classes_and_a_number_for_unknown(
    wall_scene: Callable[..., Scene], colour_oracle: Network
) -> None:
    scene = wall_scene()
    with pytest.raises(ValueError, match="colour only; expected one with classes"):
        reconstruct(scene, choose_named(scene, [0, 3]), colour_oracle, min_confidence=0.5)
    names = tuple(f"class {number}" for number in range(255))
    colour_oracle.classes = ClassTable("many", names, ((1, 2, 3),) * 255, tuple(range(255)))
    with pytest.raises(ValueError, match="255 classes; expected at most 254"):
        reconstruct(scene, choose_named(scene, [0, 3]), colour_oracle, min_confidence=0.5)


def test_the_page_tells_what_was_read_chosen_and_found(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    html = report_page(result, ORIGIN, SECONDS)
    text = text_of(html)
    for part in (
        "images/00.png", "Held-out views", result.choice.reason, result.depth_range.reason, "0.50 m to 10.00 m", "metres",
        "wall", "picture", "1.50 s", "semgs 9.9", "drawn from a hat", "semantics.ply", "transforms.json", "mIoU",
        "32x48 (height x width), read from 40x56",
    ):  # fmt: skip
        assert part in text, part
    first, bar, own, held_out, enlarged = 4, 1, 2 * 9, 2 * 9, 1
    assert html.count("<img") == first + bar + own + held_out + enlarged
    more = "True classes, measured depth, classes over the photo, confidence (black 0 %, yellow 100 %), uncertainty of depth (black 0 %, yellow 30 % or more)"
    assert (text.count(more), text.count("true classes")) == (4, 4)
    assert text.count("measured depth") == 2 * 4 + 1  # once more in the reason


def test_the_scores_are_those_of_input_views_too_in_the_words_of_an_evaluation(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    table = score_table(result)
    assert table.head == (
        "view", "mIoU/image", "mIoU/image (seen)", "acc./image", "acc./image (seen)", "PSNR", "PSNR (seen)", "depth error",
        "depth error (seen)", "unseen",
    )  # fmt: skip
    assert [row[0] for row in table.rows] == [
        "images/01.png (frame 1, held-out)", "images/02.png (frame 2, held-out)", "mean, held-out",
        "images/00.png (frame 0, input)", "images/03.png (frame 3, input)", "mean, input",
    ]  # fmt: skip
    held_out, own = score_lines(result)
    means = mean_scores(result.context.scores)
    assert held_out.startswith("held-out views: mIoU/image ")
    assert own == (
        f"input views: mIoU/image {means.miou:.2f}, acc./image {means.accuracy:.2f}, PSNR {means.psnr:.2f} dB, "
        f"depth error {means.depth.abs_rel:.2f}"
    )


def test_where_much_is_not_seen_the_scores_over_the_seen_pixels_have_a_line_of_their_own(
    wall_scene: Callable[..., Scene], colour_oracle: Network
) -> None:
    scene = wall_scene(shifts=(0.0, 0.08))
    result = reconstruct(scene, choose_named(scene, [0, 1]), colour_oracle)
    lines = score_lines(
        replace(
            result,
            target=replace(
                result.context, role="target", scores=(ViewScores(psnr=9.7, unseen=0.34, psnr_seen=19.1),) * 2
            ),
        )
    )
    assert lines[:2] == ["held-out views: PSNR 9.70 dB", "held-out views, the 66 % that is seen: PSNR (seen) 19.10 dB"]


def test_pictures_come_first_and_details_last(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    html = report_page(reconstruct(scene, choose_named(scene, [0, 3]), oracle), ORIGIN, SECONDS)
    assert re.findall(r"<h2>([^<]*)</h2>", html) == [
        "Please note", "Input views", "Held-out views", "Scores", "Files", "Details", "Time",
    ]  # fmt: skip
    assert len(re.findall(r"<details>\s*<summary><h2>", html)) == 2
    captions = [re.findall(r"<figcaption>([^<]+)</figcaption>", view) for view in html.split('<div class="view">')[1:]]
    assert [view[1:4] for view in captions] == [["render", "classes", "depth"]] * 5
    glance, captions = captions[0], captions[1:]
    assert glance == ["photo (held out)", "render", "classes", "depth"], "before the numbers"
    assert (
        html.index("At a glance")
        < html.index('class="headlines"')
        < html.index('class="legend"')
        < html.index("photo (input)")
    )
    assert captions[0][0] == "photo (input)"
    more = ["true classes", "measured depth", "classes over the photo", "confidence", "uncertainty of depth"]
    assert [[caption.split(" (")[0] for caption in view[4:]] for view in captions] == [more] * 4


def test_each_number_says_what_it_means(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    html = report_page(reconstruct(scene, choose_named(scene, [0, 3]), oracle), ORIGIN, {"encode": 1.0})
    headlines = html.split('<div class="headlines">')[1].split("<section>")[0]
    names = re.findall(r"<span>(.*?)</span>", headlines)
    assert len(names) >= 6
    assert all(re.fullmatch(r'<abbr title="[^"]{20,}" tabindex="0">[^<]+</abbr>', name) for name in names), names
    heads = re.findall(r"<th[^>]*>(.*?)</th>", html.split("<h2>Scores</h2>")[1].split("</thead>")[0])
    assert all("<abbr" in head for head in heads[1:]), heads
    assert "Of this run. The first pass of a process takes longer" in html


def test_a_page_in_3d_is_linked_at_the_top(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    assert 'href="scene.html">Look around in 3D' not in report_page(result, ORIGIN, SECONDS)
    html = report_page(result, ORIGIN, SECONDS, True)
    assert html.index('href="scene.html">Look around in 3D') < html.index("At a glance")


def test_all_files_but_the_page_itself_are_links(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    html = report_page(reconstruct(scene, choose_named(scene, [0, 3]), oracle), ORIGIN, SECONDS)
    assert re.findall(r'href="([^"]*)"', html) == [
        "report.json", "gaussians.ply", "semantics.ply", "export.json", "scene.safetensors", "renders/",
    ]  # fmt: skip


def test_where_the_unit_is_unknown_no_metre_is_mentioned(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene(metric=False)
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    text = text_of(report_page(result, ORIGIN, SECONDS))
    assert not re.search(r"\d\s?(m|mm|cm|metres|meters)\b", text)
    assert "metres" not in text
    assert "millimetres" not in text
    assert "unknown" in text
    assert "millimetre" not in json.dumps(report_numbers(result, ORIGIN, SECONDS))
    assert not any("millimetre" in output.text for output in outputs(result))


def test_a_colour_only_result_has_no_classes_anywhere(wall_scene: Callable[..., Scene], colour_oracle: Network) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), colour_oracle)
    numbers = report_numbers(result, ORIGIN, SECONDS)
    assert numbers["classes"] == []
    assert numbers["unseen"] is None
    assert numbers["model"]["classes"] is None
    assert "semantics.ply" not in [output.name for output in outputs(result)]
    assert "colour only" in text_of(report_page(result, ORIGIN, SECONDS))


def test_without_held_out_views_the_page_has_no_such_part(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene(shifts=(0.0, 0.1))
    result = reconstruct(scene, choose_named(scene, [0, 1]), oracle)
    assert report_numbers(result, ORIGIN, SECONDS)["means"]["target"] is None
    assert "Held-out views" not in text_of(report_page(result, ORIGIN, SECONDS))


def test_numbers_of_the_file_have_five_digits() -> None:
    assert rounded(1.23456789) == 1.2346
    assert rounded(float("inf")) is None
    assert rounded(None) is None
