from __future__ import annotations

import pytest

from semgs.bench.results import Bench, Result
from semgs.bench.rows import every_row
from semgs.bench.targets import TARGETS, has_bfloat16, slowness, verdicts


def bench(*results: Result, conv: float = 450.0, half: float = 900.0) -> Bench:
    return Bench({"ceilings": {"ceiling_conv_float32": conv, "ceiling_conv_bfloat16": half}}, results)


def verdict(name: str, of: Bench, quantity: str = "seconds"):
    return next(one for one in verdicts(of)[name] if one.target.quantity == quantity)


def test_every_target_is_of_a_row_that_is_measured() -> None:
    usual = {row.name for row in every_row() if not row.curve}
    assert {target.row for target in TARGETS} <= usual
    assert {target.of for target in TARGETS if target.of} <= usual


@pytest.mark.parametrize(("seconds", "met"), [(1.99, True), (2.01, False)])
def test_a_target_is_met_or_missed(seconds: float, met: bool) -> None:
    found = verdict("total_base_n2_float32", bench(Result("total_base_n2_float32", seconds)))
    assert found.met is met
    assert found.text == f"2 s: {'met' if met else 'missed'}"


def test_a_slower_machine_is_given_more_time_for_frames_and_drawing_alone() -> None:
    slow = bench(Result("render_n2", 0.15), Result("command_help", 0.5), conv=225.0)
    assert verdict("render_n2", slow).limit == pytest.approx(0.16)
    assert verdict("render_n2", slow).met
    assert verdict("command_help", slow).met is False


def test_a_faster_machine_is_given_no_less() -> None:
    assert slowness({"ceiling_conv_float32": 900.0}) == 1
    assert slowness({}) == 1
    assert slowness({"ceiling_conv_float32": 100.0}) == 4.5


def test_the_way_back_is_compared_with_the_way_there() -> None:
    both = bench(Result("render_n2", 0.1), Result("render_n2_backward", 0.31))
    assert verdict("render_n2_backward", both, "times").met is False
    assert verdict("render_n2_backward", both, "times").measured == pytest.approx(3.1)
    alone = bench(Result("render_n2_backward", 0.1))
    assert verdict("render_n2_backward", alone, "times").met is None


def test_memory_has_its_own_target() -> None:
    found = bench(Result("total_base_n4_float32", 9.0, peak_memory_mb=1900.0))
    assert verdict("total_base_n4_float32", found).met is False
    assert verdict("total_base_n4_float32", found, "peak_memory_mb").met
    assert verdict("total_base_n4_float32", found, "peak_memory_mb").text == "2,000 MB: met"


def test_without_hardware_a_bfloat16_row_says_so() -> None:
    reason = Result("total_base_n2_bfloat16", None, reason="no bf16 hardware")
    found = verdict("total_base_n2_bfloat16", bench(reason, half=500.0))
    assert found.met is None
    assert found.text == "no bf16 hardware"


@pytest.mark.parametrize(("half", "there"), [(674.0, False), (675.0, True)])
def test_hardware_for_bfloat16_is_one_and_a_half_times_as_fast(half: float, there: bool) -> None:
    assert has_bfloat16({"ceiling_conv_float32": 450.0, "ceiling_conv_bfloat16": half}, threads=2) is there
