"""Write the root's NOTICE from the ATTRIBUTION.md of the rooms that weights are trained in.

    python scripts/write_notice.py ROOMS/ATTRIBUTION.md [...]

Published networks that they started from are named below in this file.

`semgs rooms --assets` writes ATTRIBUTION.md beside its scenes. Trained live, rooms of the same seed and assets have the same works.
"""

from __future__ import annotations

import sys
from pathlib import Path

from semgs.files.atomic import write_text
from semgs.rooms.assets.notice import notice

NETWORKS = """
The class branch of the weights of SemGS was trained on, every layer, from the MobileNetV2 of a published segmentation network, and learned what
another one says of rooms. Both are Apache-2.0; their weights were dequantised, renamed and transposed, and are not in this package.

Apache-2.0 (MLCommons Association License), github.com/mlcommons/mobile_open@86a873714efd
  - start: vision/deeplab/models_and_code/checkpoints/quantize_aware_training/freeze_qat.tflite (DeepLabv3+ on MobileNetV2, ADE20K's 31 commonest classes)
  - teacher: vision/mosaic/models_and_checkpoints/R4/mobile_segmenter_r4_quant_argmax_uint8.tflite (MOSAIC, the same classes)
"""
"""Published networks that the weights that ship started from or learned from."""

if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit("usage: python scripts/write_notice.py ATTRIBUTION.md [...]")
    try:
        text = notice([Path(one).read_text(encoding="utf-8") for one in sys.argv[1:]])
    except (OSError, ValueError) as error:
        sys.exit(f"{' '.join(sys.argv[1:])}: {error}")
    write_text(Path(__file__).resolve().parent.parent / "NOTICE", text + NETWORKS)
