"""What each row of the bench runs. A run is prepared once and then called repeatedly."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import torch

from paper.bench.bench_inputs import context_views, generated_scene, load_network, target_camera, training_batch
from paper.bench.measure import WHOLE, CannotMeasureError
from paper.bench.rows import BenchRow
from semgs.data.demo_scene import demo_scene
from semgs.data.views import Views, stack
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Gaussians
from semgs.model.layers.network_input import Chunks
from semgs.model.memory.memory_plan import NotEnoughMemoryError
from semgs.model.semgs import SemGS
from semgs.rendering.render import render
from semgs.scene.photo_refinement import refine

Watch = Callable[[str], AbstractContextManager[object]]
"""A context manager around each part of a run, given its name: measures time or memory. `WHOLE` is around all parts."""

Run = Callable[[Watch], None]
"""Does the work of a row once, with a watch on each part."""

PROGRAM = "import sys; from semgs.cli.main import main; sys.exit(main())"
"""The command `semgs`, run by this interpreter."""

PROGRAM_WITH_PEAK = (
    "import sys; from semgs.cli.main import main; from paper.bench.peak_memory import peak_mb; file = sys.argv.pop(1); code = main(); "
    "open(file, 'w').write(str(peak_mb())); sys.exit(code)"
)
"""The same; writes its peak memory to the file given first [10^6 bytes]."""


COMPETITOR = "import os; parent = os.getppid(); print(flush=True)\nwhile os.getppid() == parent: sum(range(100_000))"
"""A program that computes as long as the one that started it lives."""


def prepare(row: BenchRow) -> Run:
    """Prepare the run of a row, with its number of threads.

    Raises:
        CannotMeasureError: it cannot run here.
    """
    _check(row)
    makers = {"network": _frame, "refine": _refining, "render": _drawing, "train": _training, "command": _command}
    made = makers[row.kind](row)

    def run(watch: Watch) -> None:
        torch.set_num_threads(row.threads)
        with competitors(row.beside):
            made(watch)

    return run


@contextmanager
def competitors(count: int) -> Iterator[None]:
    """Let other processes compute until the end of the block, each as much as one core can."""
    command = [sys.executable, "-c", COMPETITOR]
    others = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) for _ in range(count)]
    try:
        for other in others:
            assert other.stdout is not None
            other.stdout.readline()
        yield
    finally:
        for other in others:
            other.kill()
            other.communicate()


def compile_kernels() -> None:
    """Compile or load all kernels before anything is measured; this takes up to a minute."""
    with torch.no_grad():
        load_network("small")(context_views(2, (32, 48)))
    _backward(*generated_scene(1, (32, 48)), lambda part: nullcontext())


def command(row: BenchRow, out: Path) -> list[str]:
    """The arguments of the program for a row; output goes to the new folder `out`."""
    if row.part == "help":
        return ["--help"]
    return ["reconstruct", str(demo_scene()), "--out", str(out), "--model", row.network, "--views", str(row.views)]


def _check(row: BenchRow) -> None:
    """Refuse rows for which this machine lacks a device, library or cores."""
    if row.device == "cuda":
        if not torch.cuda.is_available():
            raise CannotMeasureError("no CUDA device")
        if row.kind in ("network", "refine", "render", "train") and find_spec("gsplat") is None:
            raise CannotMeasureError("gsplat is not installed")
        return
    import numba

    found = min(numba.config.NUMBA_DEFAULT_NUM_THREADS, numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    if found < row.threads:
        raise CannotMeasureError(f"{row.threads} threads needed, {found} here")


def _frame(row: BenchRow) -> Run:
    """Encode views, and render one target with colour, classes and depth."""
    model = load_network(row.network).to(row.device)
    views, camera = context_views(row.views, row.size), target_camera(row.size)
    chunks = _chunks(row, model, views)
    if row.batch > 1:
        views = stack([views] * row.batch)
        camera = camera.arranged(lambda array: array.expand(row.batch, *array.shape))
    # Moved to the device once, as in a program that already has its images there.
    views = views.to(row.device)
    half = row.precision == "bf16"

    def run(watch: Watch) -> None:
        with torch.no_grad(), watch(WHOLE):
            with torch.autocast(row.device, torch.bfloat16, enabled=half):
                encoding = model(views, chunks, watch)
            with watch("render"):
                encoding.render(camera)

    return run


def _refining(row: BenchRow) -> Run:
    """Refine the Gaussians of views, with the usual number of passes."""
    model, views = load_network(row.network).to(row.device), context_views(row.views, row.size).to(row.device)
    with torch.no_grad():
        encoding = model(views)

    def run(watch: Watch) -> None:
        with watch(WHOLE):
            refine(encoding, views)

    return run


def _chunks(row: BenchRow, model: SemGS, views: Views) -> Chunks:
    """The number of views that `reconstruct` would process at a time."""
    if row.batch > 1:
        return Chunks()
    try:
        return model.memory_plan(views).chunks
    except NotEnoughMemoryError as error:
        raise CannotMeasureError(str(error)) from error


def _drawing(row: BenchRow) -> Run:
    """Render the generated scene: both passes, colour only, or the backward pass."""
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
    """The backward pass for all inputs; the forward pass before it is not measured."""
    leaves = gaussians.map(lambda tensor: tensor.detach().requires_grad_())
    drawn = render(leaves, camera, near=1.0, clamp=False)
    assert drawn.semantics is not None
    loss = drawn.images.square().mean() + drawn.semantics.square().mean() + drawn.depths.mean()
    with watch(WHOLE):
        loss.backward()


def _training(row: BenchRow) -> Run:
    """A training step on one scene, with the settings of the network's preset."""
    from semgs.model.weights.load import load
    from semgs.training import presets
    from semgs.training.state import TrainingState, training_step
    from semgs.training.supervision.supervision import make_supervision

    settings = presets.PRESETS[row.network]()
    batch = training_batch(row.views, row.size, settings.targets)
    model = load(row.network, "random").to(row.device)
    state = TrainingState.begin(model, make_supervision(settings), 1e-6, 0.99)

    def run(watch: Watch) -> None:
        with watch(WHOLE):
            training_step(state, [batch], settings)

    return run


def _command(row: BenchRow) -> Run:
    """The program, from start to end."""

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
