"""Train on a folder of your own scenes, starting from the included weights.

    python examples/train_on_a_folder.py SCENES OUT [STEPS [HEIGHT WIDTH]]

SCENES is a folder of labelled scenes, as `semgs prepare` writes them. OUT is a run: weights.safetensors, its log, and
images of a scene before and after. The same command resumes an interrupted run.
"""

import sys
from dataclasses import replace
from pathlib import Path

from semgs.training import presets
from semgs.training.loop import train
from semgs.training.run.execution import Execution


def main(scenes: str, out: str, steps: int = 200, *size: int) -> None:
    """Train for some steps, all on this machine's CPU."""
    settings = replace(
        presets.small(),
        data=(scenes,),
        validation=scenes,  # better: a folder of scenes that are not trained on
        validation_scenes=1,
        validate_every=steps,
        init="small",
        steps=steps,
        batch=1,
        contexts=(2, 2),
        targets=1,
        learning_rate=5e-5,
        size=size or (120, 160),
    )
    train(settings, Path(out), Execution(workers=0))
    print(f"semgs reconstruct SCENE --out out --weights {out}/weights.safetensors")


if __name__ == "__main__":  # a training may start other processes, which import this file
    main(*sys.argv[1:3], *map(int, sys.argv[3:]))
