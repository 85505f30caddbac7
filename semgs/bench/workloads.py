"""Workloads: what each row runs. They are made once, with all that they need, and then called again and again."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import torch

from semgs.bench.measure import WHOLE, CannotMeasureError
from semgs.bench.rows import Row
from semgs.bench.scenes import context_views, generated_scene, network, target_camera, training_batch
from semgs.data.views import Views, stack
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Gaussians
from semgs.model.chunks import Chunks
from semgs.model.memory_plan import NotEnoughMemoryError, memory_plan
from semgs.model.semgs import SemGS
from semgs.rendering.render import render
from semgs.rooms.sets.demo import demo_scene

Watch = Callable[[str], AbstractContextManager[object]]
"""What stands around each part of a run, given its name: it times, or looks at memory. `WHOLE` is around all parts."""

Run = Callable[[Watch], None]
"""Does the work of a row once, with a watch around each part."""

PROGRAM = "import sys; from semgs.cli.main import main; sys.exit(main())"
"""The command `semgs`, with this interpreter."""

PROGRAM_THAT_TELLS = (
    "import sys; from semgs.cli.main import main; from semgs.bench.memory import peak_mb; told = sys.argv.pop(1); code = main(); "
    "open(told, 'w').write(str(peak_mb())); sys.exit(code)"
)
"""The same, with the most memory that it needed in the file named first [10^6 bytes]."""


def prepare(row: Row) -> Run:
    """What a row runs, with its number of threads.

    Raises:
        CannotMeasureError: it cannot be run here.
    """
    _check(row)
    makers = {"network": _frame, "render": _drawing, "train": _training, "command": _command}
    made = makers[row.kind](row)

    def run(watch: Watch) -> None:
        torch.set_num_threads(row.threads)
        made(watch)

    return run


def compile_kernels() -> None:
    """Let what is compiled on first use be compiled, or loaded, before anything is measured: that takes up to a minute."""
    with torch.no_grad():
        network("small")(context_views(2, (32, 48)))
    _backward(*generated_scene(1, (32, 48)), lambda part: nullcontext())


def command(row: Row, out: Path) -> list[str]:
    """The arguments of the program for a row of it; what it writes goes to a new folder `out`."""
    if row.part == "help":
        return ["--help"]
    return ["reconstruct", str(demo_scene()), "--out", str(out), "--model", row.network, "--views", str(row.views)]


def _check(row: Row) -> None:
    """Refuse what this machine has no device, library or cores for."""
    if row.device == "cuda":
        if not torch.cuda.is_available():
            raise CannotMeasureError("no CUDA device")
        if row.kind in ("network", "render", "train") and find_spec("gsplat") is None:
            raise CannotMeasureError("gsplat is not installed")
        return
    import numba

    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    found = min(cores, numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    if found < row.threads:
        raise CannotMeasureError(f"{row.threads} threads needed, {found} here")


def _frame(row: Row) -> Run:
    """Views to Gaussians, and one target drawn from them with colour, classes and depth."""
    model = network(row.network).to(row.device)
    views, camera = context_views(row.views, row.size), target_camera(row.size)
    chunks = _chunks(row, model, views)
    if row.batch > 1:
        views = stack([views] * row.batch)
        camera = camera.arranged(lambda array: array.expand(row.batch, *array.shape))
    # On the device once, as a program that has its pictures there would have it.
    views = views.to(row.device)
    half = row.precision == "bfloat16"

    def run(watch: Watch) -> None:
        with torch.no_grad(), watch(WHOLE):
            with torch.autocast(row.device, torch.bfloat16, enabled=half):
                encoding = model(views, chunks, watch)
            with watch("render"):
                encoding.render(camera)

    return run


def _chunks(row: Row, model: SemGS, views: Views) -> Chunks:
    """How many views at a time `reconstruct` would take."""
    if row.batch > 1:
        return Chunks()
    try:
        return memory_plan(model, views).chunks
    except NotEnoughMemoryError as error:
        raise CannotMeasureError(str(error)) from error


def _drawing(row: Row) -> Run:
    """The generated scene: both passes, colour alone, or the way back."""
    scene, camera = generated_scene(row.views, row.size)
    if row.part == "colour":
        scene = Gaussians(scene.means, scene.opacities, scene.colour)
    gaussians = scene.to(row.device)
    if row.part == "backward":
        return partial(_backward, gaussians, camera)

    def run(watch: Watch) -> None:
        with torch.no_grad(), watch(WHOLE):
            render(gaussians, camera, near=1.0)

    return run


def _backward(gaussians: Gaussians, camera: Cameras, watch: Watch) -> None:
    """Gradients of everything, from a picture and a class map that are drawn before and not watched."""
    leaves = gaussians.map(lambda tensor: tensor.detach().requires_grad_())
    drawn = render(leaves, camera, near=1.0, clamp=False)
    assert drawn.semantics is not None
    loss = drawn.images.square().mean() + drawn.semantics.square().mean() + drawn.depths.mean()
    with watch(WHOLE):
        loss.backward()


def _training(row: Row) -> Run:
    """A step on one scene, with the settings of the network's preset."""
    from semgs.training import presets
    from semgs.training.state import TrainingState
    from semgs.training.step import training_step
    from semgs.training.supervision import supervision_of
    from semgs.weights.load import load

    settings = presets.PRESETS[row.network]()
    batch = training_batch(row.views, row.size, settings.targets)
    model = load(row.network, "random").to(row.device)
    state = TrainingState.begin(model, supervision_of(settings), 1e-6, 0.99)

    def run(watch: Watch) -> None:
        with watch(WHOLE):
            training_step(state, [batch], settings)

    return run


def _command(row: Row) -> Run:
    """The program, from its start to its end."""

    def run(watch: Watch) -> None:
        with tempfile.TemporaryDirectory() as folder:
            arguments = command(row, Path(folder) / "out")
            with watch(WHOLE):
                done = subprocess.run(
                    [sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=False
                )
        if done.returncode:
            raise CannotMeasureError(f"semgs {arguments[0]} ended with {done.returncode}: {done.stderr[-200:].strip()}")

    return run
