"""Changes of `mutants_auto.py` that no test can tell from the original, each with the reason."""

from __future__ import annotations

EQUIVALENT: tuple[tuple[str, str, str, str], ...] = (
    (
        "semgs/data/choosing/choice.py",
        "between = [index for index in range(min(context) + 1, max(context)) if index not in context]",
        "between = [index for index in range(min(context) ** 1, max(context)) if index not in context]",
        "the first index is in the context, so it is left out in any case",
    ),
    (
        "semgs/data/choosing/covisibility.py",
        "inside = (depth > 0) & (x >= 0) & (x < width * depth) & (y >= 0) & (y < height * depth)",
        "inside = (depth > -1) & (x >= 0) & (x < width * depth) & (y >= 0) & (y < height * depth)",
        "with a depth of 0 or less, x cannot be both at least 0 and below width * depth",
    ),
    (
        "semgs/data/layouts/ros/camera.py",
        'if len({camera for camera, _ in names}) > 1 or (len(names) > 1 and not any("rect" in name for _, name in names)):',
        'if len({camera for camera, _ in names}) != 1 or (len(names) > 1 and not any("rect" in name for _, name in names)):',
        "there is at least one camera, because there are topics",
    ),
    ("semgs/geometry/cameras.py", "if bad.ndim == 0:", "if bad.ndim <= 0:", "arrays have no negative number of axes"),
    (
        "semgs/model/gaussians/placing.py",
        "(1 / cameras.focal_px).sum(-1).to(like),",
        "(1 / cameras.focal_px).sum(1).to(like),",
        "the cameras are [n], so the second axis is the last",
    ),
)
"""File, the line before, the line after, why nothing that can be observed differs."""
