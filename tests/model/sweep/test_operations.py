"""How many floating-point operations a network does, as torch's counter counts them: a product and its sum are two."""

from __future__ import annotations

import pytest
import torch
from networks import preset
from torch.utils.flop_counter import FlopCounterMode, sdpa_flop_count

from paper.bench.bench_inputs import context_views

PER_CHANNEL = 9
"""Of one sample of the plane sweep: four texels weighted and summed, and the product with the reference's channel."""


def of_attention(query, key, value, *args, out_shape=None, **kwargs) -> int:
    return sdpa_flop_count(query, key, value)


def of_sweep(reference, source, matrices, offsets, depths, *args, out_shape=None, **kwargs) -> int:
    n, h, w, channels = reference
    return n * h * w * depths[1] * channels * PER_CHANNEL


def test_mvsplats_encoder_counts_what_its_own_code_does() -> None:
    """407 GFLOP at 240x320, N = 2, of which 12.5 are harmonics that we leave out; 262.8 of ours are convolutions.

    Convolutions follow the number of pixels; a 25th of them are counted here. What it computes in shifted windows to be masked, 7 of
    16 products in six attentions over two views, four windows and 128 channels, we leave out as well.
    """
    aten = torch.ops.aten
    extra = {
        aten._scaled_dot_product_flash_attention_for_cpu: of_attention,
        torch.ops.semgs.correlate: of_sweep,
    }
    model = preset("mvsplat").eval()
    with FlopCounterMode(display=False, custom_mapping=extra) as mode, torch.no_grad():
        model(context_views(2, (48, 64)))
    found = mode.get_flop_counts()["Global"]
    assert found[aten.convolution] == pytest.approx(262.76e9 / 25, rel=1e-4)
    masked = 7 / 16 * 6 * (2 * 4 * (6 * 8) ** 2 * 128) * 4
    assert sum(found.values()) + masked == pytest.approx(13.16e9, rel=1e-3)
