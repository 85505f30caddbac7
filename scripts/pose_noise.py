"""What slightly wrong cameras cost, and what refining them gives back: scores of held-out views by the noise of the input views' cameras.

    python scripts/pose_noise.py small NAME=ROOMS [NAME=OTHER_ROOMS ...] --plot pose_noise.png

Each input camera is turned by the angle about a random axis and moved by the share of the mean distance between neighbouring input cameras in
a random direction, with a seed for each target. The held-out camera stays true. Cameras are refined (`semgs.sfm.camera_refinement`) either on the input
views alone, or on these and the held-out photo, as `semgs reconstruct --refine-poses` does; in the second case the held-out view is rendered
from its refined camera. The row `aligned` has true input cameras, moved together to where the noisy ones are: what is left is the error of the world's
frame, which the input views alone cannot know.
"""

from __future__ import annotations

import argparse
import sys
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float64
from scipy.spatial.transform import Rotation
from shared import markdown

from semgs.data.scene import Scene
from semgs.evaluation.frames.frame_plan import Task, make_plan
from semgs.evaluation.frames.predictions import Inputs, Method, Prediction
from semgs.evaluation.frames.protocols import TargetSample, neighbours
from semgs.evaluation.frames.reading import make_inputs, read_views
from semgs.evaluation.run import load_candidate, open_labelled_scenes
from semgs.evaluation.scoring.frame_scores import FrameScores, score
from semgs.evaluation.scoring.summary import summarise
from semgs.files.atomic import write_bytes
from semgs.files.errors import InputError
from semgs.geometry.cameras import Cameras
from semgs.geometry.rotations import nearest_rotation
from semgs.sfm.camera_refinement import refine_cameras

TURNS_DEG = (0.25, 0.5, 1.0, 2.0, 4.0)
SHIFTS = (0.005, 0.01, 0.02, 0.05, 0.1)
BOTH = (1.0, 0.02)
METRICS = {"miou": "mIoU", "psnr": "PSNR [dB]", "depth_abs_rel": "depth error"}
COLOURS = ("#4c72b0", "#c44e52", "#55a868", "#8172b3")


@dataclass(frozen=True)
class Condition:
    """What happens to the input cameras.

    Attributes:
        turn_deg: each is turned by this angle.
        shift: each is moved by this share of the mean distance between neighbouring input cameras.
        then: what is done about it: "" for nothing, or "aligned", "refined", "refined with the held-out photo".
    """

    turn_deg: float = 0.0
    shift: float = 0.0
    then: str = ""

    def __str__(self) -> str:
        noise = [f"{self.turn_deg:g}°"] * bool(self.turn_deg) + [f"{100 * self.shift:g} %"] * bool(self.shift)
        return ", ".join([" and ".join(noise) or "none", *([self.then] if self.then else [])])


CONDITIONS = (
    Condition(),
    *(Condition(turn_deg=turn) for turn in TURNS_DEG),
    *(Condition(shift=shift) for shift in SHIFTS),
    *(Condition(*BOTH, then) for then in ("", "aligned", "refined", "refined with the held-out photo")),
    *(Condition(then=then) for then in ("refined", "refined with the held-out photo")),
)


def noisy(
    poses: Float64[np.ndarray, "n 4 4"], turn_deg: float, shift: float, generator: np.random.Generator
) -> Float64[np.ndarray, "n 4 4"]:
    """Cameras (world_from_camera, in the order of the path) that are off by an angle and a share of their mean distance."""
    axes, directions = generator.normal(size=(2, len(poses), 3))
    axes, directions = (one / np.linalg.norm(one, axis=1, keepdims=True) for one in (axes, directions))
    spacing = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).mean()
    moved = poses.copy()
    moved[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(np.radians(turn_deg) * axes).as_matrix()
    moved[:, :3, 3] += shift * spacing * directions
    return moved


def aligned(fixed: Float64[np.ndarray, "n 4 4"], moving: Float64[np.ndarray, "n 4 4"]) -> Float64[np.ndarray, "n 4 4"]:
    """Cameras moved together, as a rigid body, to where the others are: by the mean rotation and the mean position."""
    turn = nearest_rotation(torch.from_numpy((fixed[:, :3, :3] @ moving[:, :3, :3].mT).sum(0))).numpy()
    result = moving.copy()
    result[:, :3, :3] = turn @ moving[:, :3, :3]
    centres = moving[:, :3, 3]
    result[:, :3, 3] = (centres - centres.mean(0)) @ turn.T + fixed[:, :3, 3].mean(0)
    return result


@dataclass(frozen=True, eq=False)
class WithNoise:
    """A method whose input cameras are slightly wrong, and perhaps refined.

    Attributes:
        method: makes the predictions.
        condition: what happens to the input cameras.
    """

    method: Method
    condition: Condition

    def predict(self, inputs: Inputs) -> Prediction:
        """The prediction for a target."""
        scene, sample = inputs.task.scene, inputs.task.sample
        order = sorted(sample.contexts)
        true = np.stack([scene.frames[index].world_from_camera for index in order])
        generator = np.random.default_rng(zlib.crc32(inputs.task.stem.encode()))
        given = noisy(true, self.condition.turn_deg, self.condition.shift, generator)
        if self.condition.then == "aligned":
            given = aligned(given, true)
        scene = with_poses(scene, dict(zip(order, given, strict=True)))
        camera = inputs.camera
        if self.condition.then.startswith("refined"):
            held_out = [sample.target] * (self.condition.then != "refined")
            scene = refine_cameras(scene, [*order, *held_out]).applied(scene)
            camera = _cameras(scene, [sample.target], camera)
        contexts = inputs.contexts.changed(cameras=_cameras(scene, sample.contexts, inputs.contexts.cameras))
        return self.method.predict(Inputs(replace(inputs.task, scene=scene), contexts, camera))


def with_poses(scene: Scene, poses: dict[int, np.ndarray]) -> Scene:
    """The scene with other cameras at some positions."""
    frames = [
        replace(frame, world_from_camera=poses[index]) if index in poses else frame
        for index, frame in enumerate(scene.frames)
    ]
    return replace(scene, frames=tuple(frames))


def _cameras(scene: Scene, frames: Sequence[int], like: Cameras) -> Cameras:
    """The cameras of some frames, with the intrinsics of others."""
    poses = np.stack([scene.frames[index].world_from_camera for index in frames])
    return Cameras(poses, like.intrinsics, like.size).relative_to(scene.origin)


def scores(method: Method, task: Task, conditions: Sequence[Condition]) -> list[FrameScores]:
    """The scores of a target under each condition."""
    views = read_views(task)
    target, inputs = views[task.sample.target], make_inputs(task, views)
    return [score(task, WithNoise(method, one).predict(inputs), target, None) for one in conditions]


def some(scene: Scene, views: int, targets: int) -> list[TargetSample]:
    """A few of the samples of the protocol `neighbours`, evenly spread."""
    every = neighbours(scene, views)
    return [every[place] for place in np.linspace(0, len(every) - 1, targets).round().astype(int)]


def table(name: str, found: dict[int, dict[Condition, dict[str, float]]]) -> str:
    """The scores of a set of rooms by noise, as Markdown."""
    heads = [f"{title}, N = {views}" for views in found for title in METRICS.values()]
    rows = []
    for condition in next(iter(found.values())):
        numbers = [found[views][condition][metric] for views in found for metric in METRICS]
        rows.append([str(condition), *[f"{number:.{2 if number > 5 else 3}f}" for number in numbers]])
    return markdown([f"{name}: noise", *heads], rows)


def plot(found: dict[str, dict[int, dict[Condition, dict[str, float]]]]) -> bytes:
    """Each metric over the noise of the rotation (above) and of the position (below), as PNG."""
    import io

    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    axes_of = (
        ("rotation off by [degrees]", [Condition(turn_deg=turn) for turn in (0.0, *TURNS_DEG)], (0.0, *TURNS_DEG)),
        (
            "position off by [% of the spacing]",
            [Condition(shift=shift) for shift in (0.0, *SHIFTS)],
            [100 * shift for shift in (0.0, *SHIFTS)],
        ),
    )
    figure = Figure(figsize=(7.5, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 3, sharey="col")
    for row, (label, conditions, places) in zip(axes, axes_of, strict=True):
        for axis, (metric, title) in zip(row, METRICS.items(), strict=True):
            curves = ((name, views) for name in found for views in found[name])
            for (name, views), colour in zip(curves, COLOURS, strict=False):
                values = [found[name][views][one][metric] for one in conditions]
                axis.plot(
                    places, values, color=colour, marker="o", markersize=2.5, linewidth=1, label=f"{name}, N = {views}"
                )
            axis.set_ylabel(title, fontsize=7)
            axis.set_xlabel(label, fontsize=7)
            axis.tick_params(labelsize=7)
    axes[0, 0].legend(fontsize=6, frameon=False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130, metadata={"Software": None})
    return buffer.getvalue()


@torch.no_grad()
def main() -> None:
    """Measure, print the tables and draw the plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights")
    parser.add_argument("data", nargs="+", metavar="NAME=ROOMS", help="a name for the tables and a folder of scenes")
    parser.add_argument("--views", nargs="+", type=int, default=[2, 4])
    parser.add_argument("--scenes", type=int, default=8, help="the first so many of each set")
    parser.add_argument("--targets", type=int, default=2, help="of each scene")
    parser.add_argument("--rows", nargs="+", help="only rows of the table with one of these words in their names")
    parser.add_argument("--plot", type=Path, help="needs all rows")
    arguments = parser.parse_args()
    conditions = [one for one in CONDITIONS if any(word in str(one) for word in arguments.rows or [""])]
    if not conditions:
        parser.error(f"no row has one of these words in its name; expected some of: {', '.join(map(str, CONDITIONS))}")
    if arguments.plot is not None and len(conditions) < len(CONDITIONS):
        parser.error("--plot needs all rows")
    found: dict[str, dict[int, dict[Condition, dict[str, float]]]] = {}
    for one in arguments.data:
        name, _, folder = one.partition("=")
        data = open_labelled_scenes(Path(folder))
        method = load_candidate(arguments.weights, data.classes, "cpu").method
        found[name] = {}
        for views in arguments.views:
            plan = make_plan(
                "some neighbours",
                lambda scene, count: some(scene, count, arguments.targets),
                data.scenes[: arguments.scenes],
                [views],
            )
            each = []
            for number, task in enumerate(plan.tasks, 1):
                each.append(scores(method, task, conditions))
                print(f"{name}, N = {views}: {number} of {len(plan.tasks)}", file=sys.stderr)
            found[name][views] = {
                condition: summarise(frames)
                for condition, frames in zip(conditions, zip(*each, strict=True), strict=True)
            }
        print(table(name, found[name]), end="\n\n", flush=True)
    if arguments.plot is not None:
        write_bytes(arguments.plot, plot(found))


if __name__ == "__main__":
    try:
        main()
    except (InputError, ValueError) as error:
        sys.exit(f"error: {error}")
