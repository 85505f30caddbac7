"""What is none of the types that a public function takes is named in one sentence, with what was expected.

Types are checked everywhere while testing, so the calls run in a process of their own, where only the functions themselves look.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.long

API = Path(__file__).resolve().parent.parent / "docs" / "api.md"

PATHS = ("3", "None", "['a']", "IMAGE", "SCENE")
THINGS = ("3", "None", "'room'", "['a']", "IMAGE", "SCENE")

CALLS = {
    "semgs.open_scene": ("{}", PATHS),
    "semgs.load": ("{}", PATHS),
    "semgs.load_scene": ("{}", PATHS),
    "semgs.load_splat": ("{}", PATHS),
    "semgs.SemGS.from_pretrained": ("{}", PATHS),
    "semgs.SemGS.save_pretrained": ("None, {}", PATHS),
    "semgs.SemGS.push_to_hub": ("None, {}", PATHS),
    "semgs.save_ply": ("'x.ply', {}", THINGS),
    "semgs.save_ply (path)": ("{}, GAUSSIANS", PATHS),
    "semgs.save_semantic_ply": ("'x.ply', {}, TABLE", THINGS),
    "semgs.save_semantic_ply (classes)": ("'x.ply', GAUSSIANS, {}", THINGS),
    "semgs.save_scene": ("'x.safetensors', {}", THINGS),
    "semgs.SavedScene.of": ("{}, VIEWS, unit='metric'", (*THINGS, "VIEWS")),
    "semgs.render": ("{}, VIEWS.cameras", (*THINGS, "VIEWS")),
    "semgs.render (cameras)": ("GAUSSIANS, {}", (*THINGS, "VIEWS")),
    "semgs.tempered": ("{}, 2.0", ("3", "None", "'room'", "['a']", "SCENE")),
    "semgs.refine": ("{}, VIEWS", (*THINGS, "VIEWS")),
    "semgs.objects": ("{}", (*THINGS, "VIEWS")),
    "semgs.Ids().update": ("{}, GAUSSIANS", (*THINGS, "VIEWS")),
    "semgs.occupancy": ("{}, VIEWS.cameras", (*THINGS, "VIEWS")),
    "semgs.occupancy (cameras)": ("GAUSSIANS, {}", (*THINGS, "VIEWS")),
    "semgs.stream": ("{}, 'small', size=(32, 48)", ("3", "None", "SCENE", "[3]", "['room']")),
    "semgs.Views.from_arrays": ("{}, VIEWS.cameras.world_from_camera, VIEWS.cameras.intrinsics", ("3", "None", "'room'", "['a']", "SCENE", "VIEWS")),
    "semgs.Views.from_arrays (poses)": ("VIEWS.images, {}, VIEWS.cameras.intrinsics", ("None", "'room'", "SCENE", "VIEWS")),
    "semgs.Cameras": ("VIEWS.cameras.world_from_camera, VIEWS.cameras.intrinsics, {}", ("3", "None", "'room'", "SCENE")),
    "SCENE.read": ("{}", ("3", "'room'", "SCENE", "VIEWS", "[None]", "[0.5]")),
    "SCENE.index": ("{}", ("None", "0.5", "['a']")),
    "semgs.training.loop.train": ("{}, Path('x')", THINGS),
    "semgs.evaluation.scoring.method_scores.score_method": ("{}, None, Path('x')", THINGS),
    "semgs.ros.frame_from_messages": ("{}, None, None", THINGS),
    "semgs.ros.views_from_messages": ("[{}], [None], [None]", THINGS),
    "semgs.ros.pose_matrix": ("{}", THINGS),
    "semgs.ros.point_cloud": ("{}, None", THINGS),
    "semgs.ros.detections": ("{}, None", THINGS),
    "semgs.ros.label_info": ("{}, None", THINGS),
    "semgs.ros.occupancy_grid": ("{}, None", THINGS),
    "semgs.ros.serialized": ("{}", THINGS),
}  # fmt: skip
"""The arguments of each function, with a place for what is given by mistake; a function may appear again for another argument."""

SCRIPT = """
import importlib, json, sys
from pathlib import Path
import numpy as np, torch
import semgs
from semgs import Gaussians, Views, open_scene
from semgs.data.tables.classes import SCANNET20 as TABLE
from semgs.geometry.gaussians import Appearance
from semgs.data.demo_scene import demo_scene
for name in ("ros", "training.loop", "evaluation.scoring.method_scores"):
    importlib.import_module(f"semgs.{name}")
SCENE = open_scene(demo_scene())
IMAGE = np.zeros((32, 48, 3), np.uint8)
K, POSES = np.array([[40.0, 0, 24], [0, 40, 16], [0, 0, 1]]), np.repeat(np.eye(4)[None], 2, 0)
POSES[1, 0, 3] = 0.2
VIEWS = Views.from_arrays([IMAGE, IMAGE], POSES, K, (0.5, 10.0))
shape = Appearance(torch.tensor([[1.0, 0, 0, 0]]), torch.ones(1, 3), torch.zeros(1, 1, 3))
GAUSSIANS = Gaussians(torch.tensor([[0.0, 0, 2]]), torch.tensor([0.5]), shape)
found = {}
for name, (arguments, wrong) in json.loads(sys.argv[1]).items():
    for given in wrong:
        text = f"{name.split(' ')[0]}({arguments.format(given)})"
        try:
            result = eval(text)
            list(result) if name == "semgs.stream" else None
            found[text] = ["nothing", ""]
        except BaseException as error:
            found[text] = [type(error).__name__, str(error)]
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def raised() -> dict[str, tuple[str, str]]:
    """Each call with the name of the error that it raised and its message."""
    done = subprocess.run([sys.executable, "-c", SCRIPT, json.dumps(CALLS)], capture_output=True, text=True, check=True)
    return {call: (kind, message) for call, (kind, message) in json.loads(done.stdout.splitlines()[-1]).items()}


@pytest.mark.parametrize("name", CALLS)
def test_a_wrong_type_is_named_with_what_was_expected(raised: dict[str, tuple[str, str]], name: str) -> None:
    arguments, wrong = CALLS[name]
    for given in wrong:
        kind, message = raised[f"{name.split(' ')[0]}({arguments.format(given)})"]
        assert kind == "TypeError", (given, kind, message)
        assert "expected " in message, (given, message)
        assert "\n" not in message
        assert len(message) < 200


def test_every_function_of_the_api_page_is_called() -> None:
    named = set(re.findall(r"autofunction:: (\S+)", API.read_text()))
    assert len(named) > 20
    assert named <= {name.split(" ")[0] for name in CALLS}
