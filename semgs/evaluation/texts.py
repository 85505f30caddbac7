"""Metrics as text: their headings and their numbers. No torch."""

from __future__ import annotations

TITLES = {
    "miou": "mIoU", "miou_per_image": "mIoU/image", "accuracy": "acc.", "accuracy_per_image": "acc./image",
    "class_accuracy": "class acc.", "class_accuracy_per_image": "class acc./image", "psnr": "PSNR", "ssim": "SSIM",
    "lpips": "LPIPS", "depth_abs_rel": "depth error", "depth_delta_125": "depth δ<1.25", "unseen": "unseen",
    "not_given": "not given", "fps_encoding_each": "FPS",
}  # fmt: skip
"""Headings of the metrics."""


def shown_number(metric: str, value: float | None) -> str:
    """A metric as text."""
    if value is None:
        return "–"
    if metric in ("unseen", "not_given"):
        return f"{100 * value:.1f} %"
    return f"{value:.2f}" if metric in ("psnr", "fps_encoding_each", "fps_encoding_shared") else f"{value:.3f}"


def with_interval(metric: str, value: float | None, low: float | None, high: float | None) -> str:
    """A metric as text, with its interval in brackets where it has one."""
    text = shown_number(metric, value)
    if low is None or high is None:
        return text
    return f"{text} [{shown_number(metric, low)}, {shown_number(metric, high)}]"
