from __future__ import annotations

import subprocess
import sys

import pytest

from paper.bench.rows import chosen_rows, every_row

NAMES = [row.name for row in every_row()]


def test_no_two_rows_have_the_same_name() -> None:
    assert len(set(NAMES)) == len(NAMES)


@pytest.mark.parametrize(
    "name",
    [
        *(f"total_{net}_n{n}_{how}" for net in ("base", "small") for n in (2, 3, 4) for how in ("float32", "bf16")),
        "cnn_base_n2", "transformer_colour_base_n2", "transformer_semantic_small_n2", "cost_volume_base_n2", "depth_small_n2",
        "heads_base_n2", "render_n2", "render_n2_colour", "render_n2_backward", "train_small_n2", "command_help",
    ],
)  # fmt: skip
def test_the_usual_rows_are_measured_unless_told_otherwise(name: str) -> None:
    assert name in [row.name for row in chosen_rows()]


def test_rows_are_named_alone_in_the_order_of_the_names_once_each() -> None:
    rows = chosen_rows(["render_n2", "total_base_n4_float32", "render_n2"])
    assert [row.name for row in rows] == ["render_n2", "total_base_n4_float32"]


def test_an_unknown_name_is_told() -> None:
    with pytest.raises(KeyError, match="render_n9"):
        chosen_rows(["render_n9"])


def test_the_stages_of_a_frame_are_measured_with_it() -> None:
    rows = {row.name: row for row in every_row()}
    assert rows["cnn_base_n2"].run == rows["heads_base_n2"].run == rows["total_base_n2_float32"].run
    assert rows["cnn_base_n2"].run != rows["cnn_small_n2"].run
    assert rows["render_n2"].run != rows["render_n2_colour"].run
    assert rows["total_small_n2_float32"].run != rows["total_small_n2_bf16"].run


def test_the_quick_look_leaves_out_what_takes_long() -> None:
    quick = chosen_rows(quick=True)
    assert len(quick) == 14  # three frames and seven parts of small, three of drawing, the help
    assert not any(row.network == "base" or row.device == "cuda" or row.kind == "train" for row in quick)


def test_names_are_known_without_torch() -> None:
    program = "import sys, paper.bench.rows, paper.bench.bench_file; assert 'torch' not in sys.modules"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=120)
