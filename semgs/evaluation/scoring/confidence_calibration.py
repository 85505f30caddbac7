"""Calibration of a network: its confidence on labelled pixels, and the temperatures that match confidence to accuracy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import torch
from jaxtyping import Float, Int
from torch import Tensor

from semgs.data.tables.classes import IGNORE
from semgs.evaluation.frames.frame_plan import FramePlan
from semgs.evaluation.frames.reading import make_inputs, read_views
from semgs.model.encode import encode
from semgs.model.semgs import SemGS
from semgs.model.weights.header_temperatures import DIGITS
from semgs.objectives.calibration import Bin, expected_calibration_error, fitted_temperature, reliability
from semgs.rendering.temperatures import Temperatures, tempered

KINDS = tuple(field.name for field in fields(Temperatures))
"""What has its own temperature: "rendered" pixels, and single "gaussians"."""

PIXELS = 2048
"""Labelled pixels sampled from each view; more would add little, because neighbours are alike."""


@dataclass(frozen=True, eq=False)
class Statements:
    """Predicted class distributions, and the true class of each."""

    distributions: Float[Tensor, "n class"]
    labels: Int[Tensor, " n"]


@dataclass(frozen=True)
class TemperatureEffect:
    """Calibration before and after a temperature is applied.

    Attributes:
        temperature: the temperature.
        error_before, error_after: expected calibration error.
        bins_before, bins_after: of the reliability plot.
    """

    temperature: float
    error_before: float
    error_after: float
    bins_before: tuple[Bin, ...]
    bins_after: tuple[Bin, ...]


def collect_statements(
    plan: FramePlan,
    network: SemGS,
    *,
    pixels: int = PIXELS,
    seed: int = 0,
    done: Callable[[int], object] = lambda count: None,
) -> dict[str, Statements]:
    """A network's class distributions on the scenes of a plan: "rendered" for target pixels, "gaussians" for the Gaussians of context pixels.

    Args:
        plan: the targets; those without labels add nothing.
        network: on the CPU, in evaluation mode.
        pixels: how many are sampled from each view.
        seed: of the sampling.
        done: called after each target with the number of finished targets.

    Raises:
        InputError: a frame cannot be used.
        NotEnoughMemoryError: the network needs more memory than there is.
    """
    generator = torch.Generator().manual_seed(seed)
    found: dict[str, list[Statements]] = {kind: [] for kind in KINDS}
    for index, task in enumerate(plan.tasks):
        views = read_views(task, plan.depth_range)
        inputs = make_inputs(task, views)
        with torch.no_grad():
            encoding = encode(network, inputs.contexts).encoding
            rendering = encoding.render(inputs.camera)
        if rendering.semantics is not None:
            found["rendered"] += sample_statements(
                rendering.semantics, [views[task.sample.target].labels], pixels, generator
            )
        labels = [views[position].labels for position in task.sample.contexts]
        found["gaussians"] += sample_statements(encoding.class_maps(), labels, pixels, generator)
        done(index + 1)
    return {kind: _joined(some, len(network.classes or ())) for kind, some in found.items()}


def measure_temperature(said: Statements, temperature: float | None = None) -> TemperatureEffect:
    """The calibration error with and without a temperature. None fits it to these statements, rounded as in a header.

    Raises:
        ValueError: there are no statements.
    """
    if temperature is None:
        temperature = round(fitted_temperature(said.distributions, said.labels), DIGITS)
    after = tempered(said.distributions, temperature)
    return TemperatureEffect(
        temperature,
        expected_calibration_error(said.distributions, said.labels),
        expected_calibration_error(after, said.labels),
        reliability(said.distributions, said.labels),
        reliability(after, said.labels),
    )


def sample_statements(
    distributions: Float[Tensor, "v class h w"], labels: list[Tensor | None], pixels: int, generator: torch.Generator
) -> list[Statements]:
    """Sampled pixels of each labelled view."""
    result = []
    for one, truth in zip(distributions, labels, strict=True):
        if truth is None:
            continue
        true = truth.flatten()
        labelled = (true != IGNORE).nonzero()[:, 0]
        kept = labelled[torch.randperm(len(labelled), generator=generator)[:pixels]]
        result.append(Statements(one.flatten(1).T[kept].float(), true[kept].long()))
    return result


def _joined(some: list[Statements], classes: int) -> Statements:
    """All of them concatenated."""
    if not some:
        return Statements(torch.zeros(0, classes), torch.zeros(0, dtype=torch.long))
    return Statements(torch.cat([one.distributions for one in some]), torch.cat([one.labels for one in some]))
