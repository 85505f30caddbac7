"""Compile the kernels before tests begin, side by side: two workers that need the same one would compile it twice.

python tests/support/kernels.py float32|float64|rooms
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

PARTS = ("float64", "rooms", "float32")
"""What is compiled in a process of its own: drawing and the plane sweep, there and back, in a precision; and what draws rooms."""


def compile_all() -> None:
    """Compile every part, or load what was compiled before; where that fails, tests tell why."""
    alone = os.environ | {"OMP_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}
    running = [
        subprocess.Popen(
            [sys.executable, __file__, part], env=alone, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for part in PARTS
    ]
    for process in running:
        process.wait()


def compile_part(part: str) -> None:
    """Call what needs the kernels of a part."""
    if part == "rooms":
        from semgs_rooms.sets.room_stream import sample

        for index in range(3):
            sample(4, index, size=(48, 64), contexts=2, targets=1)
        return
    import torch
    from networks import preset
    from posed import posed_views

    from semgs.rendering.render import render

    dtype = getattr(torch, part)
    model, views = preset("small_plain").to(dtype), posed_views(2, (32, 48), dtype=dtype)
    rendering = render(model(views).gaussians, views.cameras, near=0.5)
    assert rendering.semantics is not None
    (rendering.images.sum() + rendering.semantics.sum() + rendering.depths.sum()).backward()


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
    compile_part(sys.argv[1])
