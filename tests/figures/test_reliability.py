"""Reliability plots."""

import io

import numpy as np
from PIL import Image

from semgs.figures.plotting import RELIABILITY_COLOURS, ReliabilityPlot, reliability_png

BINS = ((0.5, 0.25, 0.4), (0.4999, 0.75, 0.6), (0.0001, 0.9, 0.1))
RED = tuple(bytes.fromhex(RELIABILITY_COLOURS[0][1:]))


def drawn(plots: list[ReliabilityPlot]) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(reliability_png(plots))).convert("RGB"))


def test_plots_stand_side_by_side_and_the_same_input_gives_the_same_bytes():
    plot = ReliabilityPlot("rendered", (("as it is", BINS),))
    one, two = drawn([plot]), drawn([plot, plot])
    assert two.shape[1] == 2 * one.shape[1]
    assert reliability_png([plot]) == reliability_png([plot])


def test_a_bin_of_almost_nothing_has_no_point():
    def reds(bins: tuple) -> int:
        above = drawn([ReliabilityPlot("", (("x", bins),))])
        return int((above[: above.shape[0] // 2, above.shape[1] // 3 :] == RED).all(-1).sum())

    assert reds(BINS) == reds((*BINS[:2], (0.0001, 0.9, 0.9)))
    assert reds(BINS) != reds((*BINS[:2], (0.1, 0.9, 0.9)))
