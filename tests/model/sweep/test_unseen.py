"""What a source view does not see, on maps made for it: behind the camera, and at the edges of its picture."""

from __future__ import annotations

import pytest
import torch

from semgs.model.sweep.correlation import correlate_fused
from semgs.model.sweep.cost_volume import correlate

ONES = torch.ones(1, 2, 3, 5, dtype=torch.float64)
FLAT = torch.zeros(1, 3, 3, dtype=torch.float64)
LIMIT = torch.full((1,), 0.01, dtype=torch.float64)


def seen_at(u: float, v: float, z: float, fused: bool) -> tuple[float, float]:
    """The correlation of maps of ones, and whether it counts, where every texel goes to (u, v) at depth z."""
    homogeneous = torch.tensor([[u, v, 1.0]], dtype=torch.float64) * max(z, 0.01)
    homogeneous[0, 2] = z
    depths = torch.ones(1, 1, dtype=torch.float64)
    if fused:
        last = ONES.permute(0, 2, 3, 1).contiguous()
        sums, seen = correlate_fused(last, last, FLAT, homogeneous, depths, LIMIT, True)
    else:
        sums, seen = correlate(ONES, ONES, FLAT, homogeneous, depths, LIMIT, True)
    return sums[0, 0, 1, 2].item(), seen[0, 0, 1, 2].item()


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize(
    ("u", "v", "z", "counts"),
    [
        (2.0, 1.0, 1.0, True),
        (2.0, 1.0, -1.0, False),
        (2.0, 1.0, 0.005, False),
        (-0.4, 1.0, 1.0, True),
        (-0.6, 1.0, 1.0, False),
        (4.4, 2.4, 1.0, True),
        (4.6, 1.0, 1.0, False),
        (2.0, 2.6, 1.0, False),
    ],
)
def test_only_what_is_in_front_and_inside_the_picture_counts(u: float, v: float, z: float, counts: bool, fused) -> None:
    product, seen = seen_at(u, v, z, fused)
    assert seen == counts
    assert product == pytest.approx(2.0 if counts else 0.0)
