"""Whole evaluations of methods that are known to the pixel."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from semgs.data.scene import Scene
from semgs.data.tables.classes import SCANNET20
from semgs.data.views import Views
from semgs.depth_maps.depth_source import FrameMaps
from semgs.evaluation.frames.frame_plan import FramePlan, make_plan
from semgs.evaluation.frames.network_method import Handling, NetworkMethod
from semgs.evaluation.frames.predictions import Inputs, Prediction
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.frames.reading import make_inputs, read_frame, read_views
from semgs.evaluation.frames.saved import SavedPredictions
from semgs.evaluation.page.evaluation_page import evaluation_page
from semgs.evaluation.run import write_evaluation
from semgs.evaluation.scoring.method_scores import MethodScores, score_method
from semgs.evaluation.scoring.score_records import encode_scores
from semgs.evaluation.scoring.summary import summarise
from semgs.evaluation.tables.comparison_tables import (
    check_comparable,
    difference_grids,
    overview_grid,
    paper_grid,
)
from semgs.evaluation.tables.environment import hardware, versions
from semgs.evaluation.tables.evaluation_report import EvaluatedMethod, Evaluation, evaluation_numbers
from semgs.evaluation.tables.saved_report import SavedReport, read_report
from semgs.evaluation.tables.table_notes import notes
from semgs.files.atomic import write_json
from semgs.files.errors import InputError
from semgs.model.encode import encode
from semgs.model.weights.load import load
from semgs.scene.encoding import Encoding
from semgs.scene.overlap import NearestViews

MakeScene = Callable[..., Scene]


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch: pytest.MonkeyPatch) -> None:
    """What intervals are is tested elsewhere; here they only have to be there, and soon."""
    monkeypatch.setattr("semgs.evaluation.scoring.intervals.RESAMPLES", 100)


class Oracle:
    """A method that reads the truth, wrong in the first `wrong` rows."""

    name = "oracle"

    def __init__(self, wrong: int = 0) -> None:
        self.wrong = wrong
        self.given: list[Inputs] = []

    def predict(self, inputs: Inputs) -> Prediction:
        self.given.append(inputs)
        truth = read_frame(inputs.task, inputs.task.sample.target, (0.5, 10.0))
        assert truth.labels is not None
        assert truth.depths is not None
        labels = truth.labels[0].clone()
        labels[: self.wrong] = 19
        image = (truth.images[0] + 0.1 * (self.wrong > 0)).clamp(0, 1)
        return Prediction(labels, image, truth.depths[0], torch.zeros(36, 48, dtype=torch.bool), 0.5, 0.125)


@pytest.fixture
def plan(make_scene: MakeScene) -> FramePlan:
    scenes = [make_scene("attic", frames=4), make_scene("hall", frames=5)]
    return make_plan("neighbours", neighbours, scenes, (2, 3), (36, 48))


def done(plan: FramePlan, rows: list[MethodScores], name: str = "oracle") -> Evaluation:
    subject = EvaluatedMethod(name, "weights", "known by heart", "0" * 64, 1)
    told = tuple(notes(plan, plan.scenes, rows, 0))
    return Evaluation(subject, "scenes", plan, tuple(rows), SCANNET20, versions(), hardware("cpu"), told)


def report(folder: Path, plan: FramePlan, rows: list[MethodScores], name: str = "oracle") -> SavedReport:
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "report.json", evaluation_numbers(done(plan, rows, name)))
    return read_report(folder)


def test_the_truth_scores_exactly_one(plan: FramePlan, tmp_path: Path):
    rows = score_method(plan, Oracle(), tmp_path)
    assert [(one.views, len(one.method)) for one in rows] == [(2, 5), (3, 5)]
    for one in rows:
        found = summarise(one.method)
        for name in (
            "miou", "miou_per_image", "accuracy", "accuracy_per_image", "class_accuracy", "class_accuracy_per_image",
            "depth_delta_125",
        ):  # fmt: skip
            assert found[name] == 1.0, name
        assert (found["not_given"], found["depth_abs_rel"], found["unseen"]) == (0, 0, 0)
        assert found["psnr"] == float("inf")


def test_saved_maps_give_the_reported_miou_to_ten_lines_of_anybodys(plan: FramePlan, tmp_path: Path):
    numbers = evaluation_numbers(done(plan, score_method(plan, Oracle(wrong=9), tmp_path)))
    for entry in numbers["results"]:
        pairs = [
            (np.array(Image.open(path)), np.array(Image.open(tmp_path / "truth" / path.parent.name / path.name)))
            for path in sorted((tmp_path / f"predictions/N{entry['views']}").glob("*/???.png"))
        ]
        given, true = (np.concatenate([one.ravel() for one in maps]) for maps in zip(*pairs, strict=True))
        ious = [
            ((given == c) & (true == c)).sum() / (((given == c) | (true == c)) & (true != 255)).sum()
            for c in np.unique(true[true != 255])
        ]
        assert entry["miou"] == pytest.approx(np.mean(ious), rel=1e-12)
        assert entry["miou"] < 0.9


def test_a_copy_of_the_nearer_context_scores_as_the_trivial_row_does(plan: FramePlan, tmp_path: Path):
    class Copier:
        name = "copier"

        def predict(self, inputs: Inputs) -> Prediction:
            scene, sample = inputs.task.scene, inputs.task.sample
            centres = {
                index: scene.frames[index].world_from_camera[:3, 3] for index in (*sample.contexts, sample.target)
            }
            near = min(
                sample.contexts, key=lambda index: float(np.linalg.norm(centres[index] - centres[sample.target]))
            )
            labels = read_frame(inputs.task, near, (0.5, 10.0)).labels
            assert labels is not None
            return Prediction(labels=labels[0])

    for one in score_method(plan, Copier(), tmp_path):
        found, copy = summarise(one.method), summarise(one.baselines["copy"])
        assert {name: copy[name] for name in found} == found
        assert "psnr" in copy
        assert 0 < found["not_given"] < 0.2


def test_a_method_is_given_neither_the_truth_nor_the_target(plan: FramePlan, tmp_path: Path):
    oracle = Oracle()
    score_method(plan, oracle, tmp_path, save=False)
    for inputs in oracle.given:
        assert (inputs.contexts.labels, inputs.contexts.depths) == (None, None)
        assert len(inputs.contexts) == inputs.task.views
        for position, centre in zip(inputs.task.sample.contexts, inputs.contexts.cameras.centres, strict=True):
            assert centre.numpy() == pytest.approx(inputs.task.scene.frames[position].world_from_camera[:3, 3])
        target = inputs.task.scene.frames[inputs.task.sample.target].world_from_camera[:3, 3]
        assert inputs.camera.centres[0].numpy() == pytest.approx(target)
    assert not (tmp_path / "predictions").exists()


def without_times(value: object) -> object:
    """A report without what a clock says."""
    if isinstance(value, dict):
        return {key: without_times(one) for key, one in value.items() if not key.startswith(("seconds", "fps"))}
    return [without_times(one) for one in value] if isinstance(value, list) else value


def network() -> NetworkMethod:
    return NetworkMethod(load("small", "random").eval(), "cpu", "small")


def test_evaluating_a_network_twice_gives_the_same_bits(plan: FramePlan, tmp_path: Path):
    few = FramePlan(plan.protocol, plan.tasks[:2] + plan.tasks[-1:])
    found = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        found.append(without_times(evaluation_numbers(done(few, score_method(few, network(), tmp_path / name)))))
    assert found[0] == found[1]
    files = sorted(path.relative_to(tmp_path / "first") for path in (tmp_path / "first").rglob("*.*"))
    assert len(files) == 3 * 4 + 3
    for path in files:
        assert (tmp_path / "first" / path).read_bytes() == (tmp_path / "second" / path).read_bytes()


def test_a_network_is_scored_by_its_arg_max_and_unseen_is_a_separate_mask(plan: FramePlan, tmp_path: Path):
    few = FramePlan(plan.protocol, plan.tasks[:1])
    rows = score_method(few, network(), tmp_path)
    stem = tmp_path / "predictions/N2/attic/001"
    labels, unseen = (np.array(Image.open(f"{stem}{end}")) for end in (".png", ".unseen.png"))
    assert labels.max() < 20
    assert set(np.unique(unseen)) <= {0, 255}
    assert rows[0].method[0].unseen == (unseen == 255).mean()
    assert rows[0].method[0].confusion is not None
    assert rows[0].method[0].truth is not None
    assert rows[0].method[0].confusion.sum() == rows[0].method[0].truth.sum()
    assert rows[0].method[0].seconds_encode is not None


def test_a_target_may_be_rendered_with_the_nearest_input_views_alone(plan: FramePlan):
    task = next(one for one in plan.tasks if len(one.sample.contexts) == 3)
    inputs, model = make_inputs(task, read_views(task)), load("small").eval()
    nearest = NearestViews(2, model.placer.shrink_seen)
    found, every = (
        NetworkMethod(model, "cpu", "small", Handling(nearest=one)).predict(inputs) for one in (nearest, None)
    )
    encoding = nearest(encode(model, inputs.contexts).encoding, inputs.contexts.cameras, inputs.camera)
    assert found.image is not None
    assert every.image is not None
    torch.testing.assert_close(found.image, encoding.render(inputs.camera).images[0])
    assert not torch.equal(found.image, every.image)


def test_depth_maps_halve_the_error_of_a_bent_network(plan: FramePlan):
    """The network's depth is up to 20 % too near on the left and too far on the right. The scene's own depth, taken as maps of unknown scale, is exact."""
    task = next(one for one in plan.tasks if len(one.sample.contexts) == 2)
    views = read_views(task)
    depths = [views[position].depths for position in task.sample.contexts]
    truth = torch.cat([one for one in depths if one is not None])
    small = load("small").eval()

    class Bent(torch.nn.Module):
        name, classes = "bent", SCANNET20

        def __init__(self, most: float) -> None:
            super().__init__()
            self.most = most

        def forward(self, contexts: Views) -> Encoding:
            bend = self.most * torch.linspace(-1, 1, contexts.size[1])
            return small(contexts).with_depths(truth * bend.exp(), contexts.cameras, depth_spread=0 * truth + 0.2)

    def rendered_depth(
        most: float, depth: Callable[[Scene], FrameMaps] | None = None, sensor: bool = False
    ) -> torch.Tensor:
        handling = Handling(depth=depth, sensor=sensor)  # type: ignore[arg-type]
        predicted = NetworkMethod(Bent(most), "cpu", "bent", handling).predict(inputs)  # type: ignore[arg-type]
        assert predicted.depths is not None
        return predicted.depths.clamp(min=0.1).log()

    inputs = make_inputs(task, views)
    assert inputs.contexts.depths is None
    exact, bent, helped = (
        rendered_depth(0), rendered_depth(0.2), rendered_depth(0.2, lambda scene: FrameMaps()),
    )  # fmt: skip
    assert float((helped - exact).abs().mean()) < float((bent - exact).abs().mean()) / 2
    # A sensor is believed, whatever the network says.
    torch.testing.assert_close(rendered_depth(0.2, sensor=True), rendered_depth(0, sensor=True), rtol=0, atol=2e-3)
    with pytest.raises(InputError, match="expected measured depth in each input view for --depth sensor"):
        NetworkMethod(Bent(0), "cpu", "bent", Handling(sensor=True)).predict(replace(inputs, measured=None))  # type: ignore[arg-type]


@pytest.mark.long
def test_a_refined_network_is_scored_beside_itself_before(plan: FramePlan, tmp_path: Path):
    tasks = tuple(task for task in plan.tasks if len(task.sample.contexts) == 2)[:2]
    few = replace(plan, tasks=tasks)
    model = load("small").eval()
    scored = []
    for passes in (0, 2):
        (tmp_path / str(passes)).mkdir()
        (rows,) = score_method(
            few, NetworkMethod(model, "cpu", "small", Handling(passes=passes)), tmp_path / str(passes)
        )
        scored.append(rows)
    plain, refined = scored
    assert "one_pass" not in plain.baselines
    assert [frame.psnr for frame in refined.baselines["one_pass"]] == [frame.psnr for frame in plain.method]
    assert [frame.psnr for frame in refined.method] != [frame.psnr for frame in plain.method]


@pytest.mark.long
def test_two_workers_give_the_same_numbers(plan: FramePlan, tmp_path: Path):
    found = []
    for workers in (0, 2):
        (tmp_path / str(workers)).mkdir()
        rows = score_method(plan, network(), tmp_path / str(workers), workers=workers)
        found.append([summarise(one.method) for one in rows])
    for alone, together in zip(*found, strict=True):
        assert together == pytest.approx(alone, rel=1e-4)


def test_progress_is_told_after_every_target_and_a_broken_file_ends_the_work(plan: FramePlan, tmp_path: Path):
    told: list[int] = []
    score_method(plan, Oracle(), tmp_path, save=False, done=told.append)
    assert told == list(range(1, len(plan.tasks) + 1))
    picture = plan.tasks[3].scene.frames[2].picture
    picture.write_bytes(picture.read_bytes()[:200])
    with pytest.raises(InputError, match=r"hall.*images.*002\.png"):
        score_method(plan, Oracle(), tmp_path, save=False)


def test_scenes_without_labels_count_in_colour_and_depth_only_and_it_is_said(make_scene: MakeScene, tmp_path: Path):
    class Blind(Oracle):
        def predict(self, inputs: Inputs) -> Prediction:
            views = read_frame(inputs.task, inputs.task.sample.target, (0.5, 10.0))
            return Prediction(
                torch.zeros(36, 48).byte(), views.images[0] * 0.9, None if views.depths is None else views.depths[0]
            )

    scenes = [make_scene("attic", frames=4), make_scene("bare", frames=4, labels=False, depth=False)]
    plan = make_plan("neighbours", neighbours, scenes, (2,), (36, 48))
    (rows,) = score_method(plan, Blind(), tmp_path)
    assert [frame.confusion is None for frame in rows.method] == [False, False, True, True]
    assert len(rows.baselines["majority"]) == 2
    assert len(rows.baselines["warp"]) == 2
    alone = score_method(make_plan("neighbours", neighbours, scenes[:1], (2,), (36, 48)), Blind(), tmp_path)[0]
    found, expected = summarise(rows.method), summarise(alone.method)
    assert found["miou_per_image"] == expected["miou_per_image"]
    assert found["psnr"] != expected["psnr"]
    told = " ".join(notes(plan, scenes, [rows], 0))
    assert "No labels in bare: only metrics of colour and depth use these scenes." in told
    assert "No depth in bare" in told


def test_a_report_survives_its_file(plan: FramePlan, tmp_path: Path):
    rows = score_method(plan, Oracle(wrong=9), tmp_path)
    saved = report(tmp_path / "a", plan, rows)
    for one in rows:
        again = saved.results[one.views]
        assert summarise(again.frames) == pytest.approx(summarise(one.method), rel=1e-12)
        assert again.numbers["miou"] == summarise(one.method)["miou"]
        assert again.numbers["fps_encoding_each"] == pytest.approx(1 / 0.625)
        assert again.numbers["fps_encoding_shared"] == pytest.approx(8)
        assert set(again.baselines) == {"copy", "warp", "majority"}
        assert [scene["scene"] for scene in again.numbers["per_scene"]] == ["attic", "hall"]
        assert len(again.numbers["per_class"]) == 20
        low, high = again.numbers["intervals"]["miou"]
        assert low <= again.numbers["miou"] <= high
        assert again.numbers["intervals_over"] == "frames"
    text = json.loads((tmp_path / "a/report.json").read_text())
    for key in ("protocol", "frames", "versions", "hardware", "method"):
        assert text[key]


def test_scores_over_the_seen_pixels_are_shown_where_a_twentieth_was_not_seen(plan: FramePlan, tmp_path: Path):
    saved = report(tmp_path / "a", plan, score_method(plan, Oracle(wrong=9), tmp_path))

    def columns(unseen: float) -> set[str]:
        """Headings of the table of a terminal if so much was not seen from two views."""
        result = saved.results[2]
        numbers = {**result.numbers, "unseen": unseen, "psnr_seen": 21.0, "depth_abs_rel_seen": 0.1}
        return set(overview_grid(replace(saved, results={2: replace(result, numbers=numbers)})).head)

    assert {"PSNR (seen)", "depth error (seen)"} <= columns(0.06)
    assert not {"PSNR (seen)", "depth error (seen)"} & columns(0.04)


def test_a_report_from_before_the_scores_over_the_seen_pixels_is_read(plan: FramePlan, tmp_path: Path):
    report(tmp_path / "a", plan, score_method(plan, Oracle(wrong=9), tmp_path))
    path = tmp_path / "a/report.json"
    text = json.loads(path.read_text())
    for entry in text["results"]:
        for row in (entry, *entry["trivial"].values(), *entry["per_frame"]):
            for name in [name for name in row if name.endswith("_seen")]:
                del row[name]
    path.write_text(json.dumps(text))
    old = read_report(path).results[2]
    assert old.numbers["psnr"] == text["results"][0]["psnr"]
    assert old.frames[0].psnr_seen is None
    assert old.frames[0].depth_seen is None


def test_a_score_below_the_copy_is_marked(plan: FramePlan, tmp_path: Path):
    rows = score_method(plan, Oracle(wrong=30), tmp_path)
    saved = report(tmp_path / "a", plan, rows)
    found = saved.results[2]
    worse = [name for name in ("miou", "accuracy") if found.numbers[name] < found.baselines["copy"][name]]
    assert set(worse) <= set(found.numbers["below_copy"])
    assert "depth_abs_rel" not in found.numbers["below_copy"]
    grid = overview_grid(saved)
    first = dict(zip(grid.head, grid.rows[0], strict=True))
    assert first["acc."].marked == ("accuracy" in found.numbers["below_copy"])
    assert any(cell.marked for cell in grid.rows[0])
    assert "worse than the oracle that copies the nearest input view" in " ".join(notes(plan, plan.scenes, rows, 0))


@pytest.mark.long
def test_reports_of_other_frames_sizes_or_truth_are_not_compared(
    plan: FramePlan, make_scene: MakeScene, tmp_path: Path
):
    def of(plan: FramePlan, name: str) -> SavedReport:
        return report(tmp_path / name, plan, score_method(plan, Oracle(), tmp_path, save=False), name)

    base = of(plan, "base")
    check_comparable([base, of(FramePlan("pinned: neighbours", plan.of(2)), "some")])
    tasks = plan.tasks
    with pytest.raises(InputError, match="4 targets instead of 5"):
        check_comparable([base, of(FramePlan("n", tasks[1:5]), "fewer")])
    with pytest.raises(InputError, match=r"target attic/images/002\.png instead of attic/images/001\.png"):
        check_comparable([base, of(FramePlan("n", (tasks[1], tasks[0], *tasks[2:5])), "other")])
    labels = tasks[0].scene.frames[1].labels.path
    assert labels is not None
    Image.fromarray(np.zeros((36, 48), np.uint8)).save(labels)
    with pytest.raises(InputError, match=r"changed.*the same targets as .*base.*other true labels or depths"):
        check_comparable([base, of(plan, "changed")])


@pytest.mark.long
def test_tables_of_several_reports(plan: FramePlan, tmp_path: Path):
    reports = [
        report(tmp_path / name, plan, score_method(plan, Oracle(wrong), tmp_path, save=False), "oracle")
        for name, wrong in (("poor", 18), ("good", 4))
    ]
    paper = paper_grid(reports)
    assert [row[0].text for row in paper.rows] == [
        "oracle (poor)", "oracle (good)", "oracle: nearest input view's true labels", "warped with true depth", "most frequent class",
    ]  # fmt: skip
    assert paper.groups == (("2 input views", 4), ("3 input views", 4))
    assert paper.rules == (2,)
    value = reports[1].results[3].numbers["miou_per_image"]
    assert paper.rows[1][5].text == f"{value:.3f}"
    assert [cell.best for cell in paper.rows[1][1:4]] == [True] * 3
    assert not any(cell.best for cell in paper.rows[0][1:4])
    (grid,) = difference_grids(reports)
    assert grid.head == ("metric", "views", "oracle (poor)", "oracle (good)", "difference", "95 % interval")
    first = grid.rows[0]
    before, after = (one.results[2].numbers["miou"] for one in reports)
    assert [cell.text for cell in first[:5]] == ["mIoU", "2", f"{before:.3f}", f"{after:.3f}", f"+{after - before:.3f}"]
    assert first[4].marked


def test_the_page_holds_tables_bars_matrix_and_pictures_and_loads_nothing(plan: FramePlan, tmp_path: Path):
    rows = score_method(plan, Oracle(wrong=9), tmp_path)
    page = evaluation_page(done(plan, rows), report(tmp_path / "a", plan, rows))
    assert page.count('class="bars"') == page.count('class="matrix"') == 2
    assert page.count('class="gallery"') == 10
    for text in (
        "oracle on scenes", "Best 1: ", "Worst 1: ", "oracle: nearest input view&#39;s true labels", "known by heart", "0" * 64, "attic",
        "mIoU from 2 views", "bootstrap over frames", "depth error", "PSNR",
    ):  # fmt: skip
        assert text in page, text
    assert page.count("<script") == page.count("<script>") == 1
    assert "http" not in page


@pytest.mark.long
def test_the_report_that_is_handed_on_is_the_one_in_the_file(plan: FramePlan, tmp_path: Path):
    """To the last number, infinite PSNR of the oracle included."""
    evaluation = done(plan, score_method(plan, Oracle(), tmp_path))
    handed = write_evaluation(tmp_path, evaluation)
    read = read_report(tmp_path)
    assert overview_grid(handed) == overview_grid(read)
    for views, result in read.results.items():
        assert handed.results[views].numbers == result.numbers
        assert [encode_scores(frame) for frame in handed.results[views].frames] == [
            encode_scores(frame) for frame in result.frames
        ]
    page = (tmp_path / "report.html").read_text()
    assert page == evaluation_page(evaluation, read)


def test_what_is_shown_of_the_best_and_worst_is_what_was_predicted(plan: FramePlan, tmp_path: Path):
    rows = score_method(plan, Oracle(wrong=9), tmp_path)
    saved = SavedPredictions(tmp_path / "predictions", "x")
    for one in rows:
        assert set(one.shown) == {(task.scene.name, task.target) for task in plan.of(one.views)}
        for task in plan.of(one.views):
            held, read = one.shown[task.scene.name, task.target], saved.read(task)
            assert held.image is not None
            assert read.image is not None
            assert (held.image - read.image).abs().max() < 0.51 / 255
            assert held.depths is not None
            assert read.depths is not None
            assert (held.depths - read.depths).abs().max() < 0.00051


@pytest.mark.long
def test_a_method_that_says_how_sure_it_is_has_its_curve_in_report_and_page(plan: FramePlan, tmp_path: Path):
    class Sure(Oracle):
        """Sure of what is right, and at 0.6 of the wrong rows."""

        def predict(self, inputs: Inputs) -> Prediction:
            confidences = torch.full((36, 48), 0.99)
            confidences[: self.wrong] = 0.6
            return replace(super().predict(inputs), confidences=confidences)

    rows = score_method(plan, Sure(wrong=9), tmp_path)
    evaluation = done(plan, rows)
    saved = report(tmp_path, plan, rows)
    for result in saved.results.values():
        curve = {point["coverage"]: point["risk"] for point in result.numbers["risk_coverage"]}
        assert curve[0.5] == 0
        assert curve[1.0] == pytest.approx(1 - result.numbers["accuracy"])
        assert 0 < result.numbers["aurc"] < curve[1.0]
        assert summarise(result.frames)["ece"] == pytest.approx(result.numbers["ece"])
    html = evaluation_page(evaluation, saved)
    assert html.count("Confidence from") == 2
    assert "wrong classes among the most confident pixels" in html
    plain = evaluation_numbers(done(plan, score_method(plan, Oracle(wrong=9), tmp_path)))
    assert [entry["risk_coverage"] for entry in plain["results"]] == [[], []]
    assert [entry["ece"] for entry in plain["results"]] == [None, None]
