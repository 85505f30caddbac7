"""Score another method on the same frames and with the same metrics as SemGS.

    python examples/score_another_method.py SCENES OUT

SCENES is a folder of labelled scenes. OUT gets the predictions as images.
"""

import sys
from pathlib import Path

import torch

from semgs import load
from semgs.data.scenes import open_scenes
from semgs.data.tables.classes import SCANNET20
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.network_method import NetworkMethod
from semgs.evaluation.frames.predictions import Inputs, Prediction
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.scoring.method_scores import score_method
from semgs.evaluation.scoring.summary import summarise


class LowIsFloor:
    """Shows the first input view again, and calls the lower third of the image floor and the rest wall."""

    name = "low is floor"

    def predict(self, inputs: Inputs) -> Prediction:
        """It is given images and cameras of the input views and the target's camera; no labels and no depths."""
        image, labels = inputs.contexts.images[0], torch.full(inputs.camera.size, SCANNET20.index("wall")).byte()
        labels[2 * len(labels) // 3 :] = SCANNET20.index("floor")
        return Prediction(labels=labels, image=image)


plan = make_plan("neighbours", neighbours, open_scenes(Path(sys.argv[1])), views=[2], size=(120, 160))
for method in (LowIsFloor(), NetworkMethod(load("small"), "cpu", "small")):
    (folder := Path(sys.argv[2]) / method.name).mkdir(parents=True, exist_ok=True)
    for rows in score_method(plan, method, folder):
        print(method.name, {name: round(summarise(rows.method)[name], 3) for name in ("miou", "accuracy", "psnr")})
