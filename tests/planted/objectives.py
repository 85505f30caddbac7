"""Errors planted in `semgs/objectives`."""

from __future__ import annotations

from planted.mutant import Mutant

LOSSES = "semgs/objectives/losses.py"
DEPTH_LOSSES = "semgs/objectives/depth_losses.py"
METRICS = "semgs/objectives/metrics.py"
OF_LOSSES = ("tests/objectives/test_losses.py",)
OF_DEPTH_LOSSES = ("tests/objectives/test_depth_losses.py",)
OF_METRICS = ("tests/objectives/test_metrics.py",)
OF_VIEW_SCORES = ("tests/run/test_scores.py",)
OF_SELECTIVE = ("tests/objectives/test_selective.py",)

OBJECTIVES = (
    Mutant(
        "ignored pixels count as labelled", LOSSES,
        "[:, 0], labels != IGNORE", "[:, 0], labels <= IGNORE", OF_LOSSES,
    ),
    Mutant(
        "smoothness reaches across borders", LOSSES,
        "down = (labels[..., 1:, :] == labels[..., :-1, :]) & labelled[..., 1:, :]", "down = labelled[..., :-1, :] & labelled[..., 1:, :]",
        OF_LOSSES,
    ),
    Mutant(
        "smoothness looks right alone", LOSSES,
        "(probability.diff(dim=-2).abs() * down)", "(0 * probability.diff(dim=-2).abs() * down)", OF_LOSSES,
    ),
    Mutant(
        "the mean runs over the pixels of all views, not over views", LOSSES,
        "return sums / known.sum((-2, -1)).clamp(min=1)",
        "return (sums.sum() / known.sum().clamp(min=1)).expand_as(sums)", OF_LOSSES,
    ),
    Mutant(
        "cross-entropy is of log 2", LOSSES,
        "(probability.dtype).tiny).log()", "(probability.dtype).tiny).log2()", OF_LOSSES,
    ),
    Mutant(
        "a true depth goes to the wrong one of its two candidates", DEPTH_LOSSES,
        "share = (position - lower)", "share = 1 - (position - lower)", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "true depth is divided between candidates in depth, not in inverse depth", DEPTH_LOSSES,
        'if spacing == "linear"', 'if spacing != ""', OF_DEPTH_LOSSES,
    ),
    Mutant(
        "gradient matching steps into holes", DEPTH_LOSSES,
        "known[..., 1:] & known[..., :-1]", "known[..., 1:] | known[..., :-1]", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "a texel has the depth of its corner", DEPTH_LOSSES,
        "truth[..., SHRINK // 2 :: SHRINK, SHRINK // 2 :: SHRINK]", "truth[..., ::SHRINK, ::SHRINK]", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "the semantic loss weighs as much as colour", "semgs/objectives/loss_weights.py",
        "semantic: float = 0.1", "semantic: float = 1.0", OF_LOSSES,
    ),
    Mutant(
        "the union counts hits twice", METRICS,
        "confusion.sum(-1) + confusion.sum(-2) - hits)", "confusion.sum(-1) + confusion.sum(-2))", OF_METRICS,
    ),
    Mutant(
        "mean IoU counts classes that are only predicted", METRICS,
        "counted = confusion.sum(-1) > 0 if present is None", "counted = confusion.sum(-1) + confusion.sum(-2) > 0 if present is None",
        OF_METRICS,
    ),
    Mutant(
        "class accuracy is a precision", METRICS,
        "_ratio(hits, confusion.sum(-1))", "_ratio(hits, confusion.sum(-2))", OF_METRICS,
    ),
    Mutant(
        "sharp depth follows the bias of surfaces", DEPTH_LOSSES,
        "(error - shift).abs()", "error.abs()", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "the shift of the truth learns", DEPTH_LOSSES,
        "_smoothed(error.detach(), known & ~near)", "_smoothed(error, known & ~near)", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "the truth is shifted by the error at edges", DEPTH_LOSSES,
        "_smoothed(error.detach(), known & ~near)", "_smoothed(error.detach(), known)", OF_DEPTH_LOSSES,
    ),
    Mutant(
        "PSNR is of the square of the error", METRICS,
        "return -10 * squared_error(", "return -20 * squared_error(", OF_METRICS,
    ),
    Mutant(
        "a risk-coverage curve begins with the least confident", "semgs/objectives/selective.py",
        "pixels = counts[..., ::-1, 0]", "pixels = counts[..., 0]", OF_SELECTIVE,
    ),
    Mutant(
        "the area under a risk-coverage curve forgets earlier errors", "semgs/objectives/selective.py",
        "(missed - wrong - rate * before) * growth", "(0 - rate * before) * growth", OF_SELECTIVE,
    ),
    Mutant(
        "errors of calibration cancel within all bins", "semgs/objectives/selective.py",
        "np.abs(sums).sum(-1)", "np.abs(sums.sum(-1))", OF_SELECTIVE,
    ),
    Mutant(
        "classes over the seen pixels are over all", "semgs/objectives/metrics.py",
        "truth.labels.masked_fill(~seen, IGNORE)", "truth.labels", OF_VIEW_SCORES,
    ),
    Mutant(
        "hidden pixels count in PSNR as if they were right", "semgs/objectives/metrics.py",
        "/ shown.sum((-2, -1)).clamp(min=1)", "/ shown.numel()",
        ("tests/objectives/test_metrics.py::test_hidden_pixels_do_not_count_in_psnr",),
    ),
)  # fmt: skip
