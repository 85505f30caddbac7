from __future__ import annotations

import subprocess
import sys

import pytest

from semgs.bench.rows import chosen_rows, every_row

NAMES = [row.name for row in every_row()]


def test_no_two_rows_have_the_same_name() -> None:
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize(
    "name",
    [
        *(f"ceiling_{what}_{how}" for what in ("conv", "matmul", "attention") for how in ("float32", "bfloat16")),
        *(f"total_{net}_n{n}_{how}" for net in ("base", "small") for n in (2, 3, 4) for how in ("float32", "bfloat16")),
        "cnn_base_n2", "transformer_colour_base_n2", "transformer_semantic_small_n2", "cost_volume_base_n2", "depth_small_n2",
        "heads_base_n2", "render_n2", "render_n2_colour", "render_n2_backward", "train_small_n2", "command_help",
    ],
)  # fmt: skip
def test_the_usual_rows_are_measured_unless_told_otherwise(name: str) -> None:
    assert name in [row.name for row in chosen_rows()]


def test_other_sizes_and_threads_are_in_the_name_and_belong_to_the_curves() -> None:
    curves = {row.name: row for row in chosen_rows(curves=True)}
    row = curves["total_small_n8_float32_480x640_t1"]
    assert (row.views, row.size, row.threads) == (8, (480, 640), 1)
    assert curves["total_base_n8_float32"].curve
    assert not any(row.curve for row in chosen_rows())
    assert not any("480x640" in row.name or "_t1" in row.name for row in chosen_rows())


def test_the_curves_have_every_number_of_views_size_and_number_of_threads() -> None:
    found = {
        (row.network, row.views, row.size, row.threads)
        for row in chosen_rows(curves=True)
        if (row.kind, row.part, row.precision, row.device) == ("network", "total", "float32", "cpu")
    }
    assert found == {
        (network, views, size, threads)
        for network in ("base", "small")
        for views in range(2, 9)
        for size in ((120, 160), (240, 320), (480, 640))
        for threads in (1, 2)
    }


def test_rows_are_named_alone_in_the_order_of_the_names_once_each() -> None:
    rows = chosen_rows(["render_n2", "total_base_n8_float32_480x640_t1", "render_n2"])
    assert [row.name for row in rows] == ["render_n2", "total_base_n8_float32_480x640_t1"]


def test_an_unknown_name_is_told() -> None:
    with pytest.raises(KeyError, match="render_n9"):
        chosen_rows(["render_n9"])


def test_the_stages_of_a_frame_are_measured_with_it() -> None:
    rows = {row.name: row for row in every_row()}
    assert rows["cnn_base_n2"].run == rows["heads_base_n2"].run == rows["total_base_n2_float32"].run
    assert rows["cnn_base_n2"].run != rows["cnn_small_n2"].run
    assert rows["render_n2"].run != rows["render_n2_colour"].run
    assert rows["total_small_n2_float32"].run != rows["total_small_n2_bfloat16"].run


def test_the_quick_look_leaves_out_what_takes_long() -> None:
    quick = chosen_rows(quick=True)
    assert 15 < len(quick) < 30
    assert not any(row.network == "base" or row.device == "cuda" or row.kind == "train" for row in quick)


def test_names_are_known_without_torch() -> None:
    program = (
        "import sys, semgs.bench.rows, semgs.bench.results, semgs.bench.targets; assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
