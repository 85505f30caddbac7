"""The metrics in words: their names, number formats and meanings, wherever they are printed. No torch.

`semgs reconstruct`, `evaluate`, `compare` and their reports take their words from here; docs/evaluate.md has the same table.
"""

from __future__ import annotations

TITLES = {
    "miou": "mIoU", "miou_per_image": "mIoU/image", "miou_per_image_seen": "mIoU/image (seen)", "accuracy": "acc.",
    "accuracy_per_image": "acc./image", "accuracy_per_image_seen": "acc./image (seen)", "class_accuracy": "class acc.",
    "class_accuracy_per_image": "class acc./image", "miou_merged": "mIoU (merged)", "accuracy_merged": "acc. (merged)",
    "aurc": "AURC", "ece": "ECE", "covered_95": "at 95 %", "psnr": "PSNR", "psnr_seen": "PSNR (seen)", "ssim": "SSIM", "lpips": "LPIPS",
    "depth_abs_rel": "depth error", "depth_abs_rel_seen": "depth error (seen)", "depth_delta_125": "depth δ<1.25",
    "psnr_edges": "PSNR (edges)", "depth_edges": "depth error (edges)", "psnr_gradients": "PSNR (gradients)", "made_up": "made up", "flyers": "flyers", "changed_classes": "classes changed", "changed_depth": "depth changed",
    "obstacles_free": "obstacles called free", "free_found": "free floor found", "obstacle_error": "obstacle ahead [m]",
    "pq": "PQ", "sq": "SQ", "rq": "RQ", "instance_miou": "mIoU (things)", "box_recall_25": "boxes found at .25", "box_precision_25": "right at .25",
    "box_recall_50": "found at .5", "box_precision_50": "right at .5",
    "unseen": "unseen", "not_given": "not given", "fps_encoding_each": "FPS",
}  # fmt: skip
"""Headings of the metrics, in the order of tables."""

MEANINGS = {
    "psnr": "over all pixels, in dB",
    "miou_per_image": "of each view, over the classes that its true labels show",
    "accuracy_per_image": "share of each view's labelled pixels with the true class",
    "depth_abs_rel": "mean of |z − truth| / truth over all pixels with a true depth",
    "unseen": "share of the pixels with alpha below 0.5; “(seen)” is over the others alone",
}
"""Explanations of the metrics in the report of one scene, as phrases after the heading."""

EXPLANATIONS = {
    "psnr": "How close the render is to the photo, in decibels, over all pixels. Higher is better: below 20 is blurred or wrong, 25 is good, 30 is hard to tell from the photo.",
    "psnr_seen": "PSNR over the pixels that an input view sees.",
    "miou_per_image": "Mean intersection over union of each view: for each class of its true labels, the pixels that have the class in both maps, divided by those that have it in one of them; then the mean over classes. 1 is perfect.",
    "miou_per_image_seen": "mIoU over the pixels that an input view sees.",
    "accuracy_per_image": "Share of each view's labelled pixels that have the true class. 1 is perfect.",
    "accuracy_per_image_seen": "The same over the pixels that an input view sees.",
    "depth_abs_rel": "Mean of |depth - true depth| / true depth. 0.06 means that depth is wrong by 6 % on average.",
    "depth_abs_rel_seen": "Depth error over the pixels that an input view sees.",
    "unseen": "Share of the pixels that no input view sees: their alpha is below 0.5.",
    "ssim": "Structural similarity of render and photo; 1 is identical.",
}
"""What metrics mean, as sentences for somebody who does not know them."""

MOSTLY_SEEN = 0.95
"""If less of the views than this was seen, scores over all pixels mostly measure the unseen part."""


def shown_number(measure: str, value: float | None, digits: int = 3) -> str:
    """A metric as text; `digits` after the point for those that papers print with three, such as mIoU."""
    if value is None:
        return "–"
    if measure in (
        "unseen",
        "not_given",
        "covered_95",
        "made_up",
        "flyers",
        "changed_classes",
        "changed_depth",
        "obstacles_free",
        "free_found",
    ):
        return f"{100 * value:.1f} %"
    return (
        f"{value:.2f}"
        if measure
        in (
            "psnr",
            "psnr_seen",
            "psnr_edges",
            "psnr_gradients",
            "obstacle_error",
            "fps_encoding_each",
            "fps_encoding_shared",
        )
        else f"{value:.{digits}f}"
    )
