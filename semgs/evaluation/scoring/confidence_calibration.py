"""Calibration of a network: its confidence on labelled pixels, and the temperatures that match confidence to accuracy.

Are predictions with 80 % confidence right in 80 % of cases? One temperature brings them closer to that: `semgs.rendering.temperatures` says what a temperature does to a rendered pixel or to a Gaussian's own distribution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import torch
from jaxtyping import Float, Int
from scipy.optimize import minimize_scalar
from torch import Tensor
from torchmetrics.functional.classification import multiclass_calibration_error

from semgs.data.tables.classes import IGNORE
from semgs.evaluation.frames.frame_plan import FramePlan
from semgs.evaluation.frames.reading import make_inputs, read_views
from semgs.model.encode import encode
from semgs.model.semgs import SemGS
from semgs.model.weights.header import DIGITS
from semgs.rendering.temperatures import Temperatures, logarithms, tempered

KINDS = tuple(field.name for field in fields(Temperatures))
"""What has its own temperature: "rendered" pixels, and single "gaussians"."""

PIXELS = 2048
"""Labelled pixels sampled from each view; more would add little, because neighbours are alike."""

BINS = 15
"""Bins of confidence, equally wide, as in Guo et al."""

COLDEST, HOTTEST = 0.05, 20.0
"""Range in which a temperature is searched."""


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


@dataclass(frozen=True)
class Bin:
    """Pixels whose largest probability lies in a range.

    Attributes:
        share: of all pixels.
        confidence: mean of their largest probability, 0 without pixels.
        accuracy: share of them that are right, 0 without pixels.
    """

    share: float
    confidence: float
    accuracy: float


def fitted_temperature(distributions: Float[Tensor, "n class"], labels: Int[Tensor, " n"]) -> float:
    """The temperature that minimises the negative log-likelihood of labelled distributions, between 0.05 and 20.

    The negative log-likelihood is convex in 1 / T, so a bounded search over 1 / T finds its only minimum.

    Raises:
        ValueError: there are no labels.
    """
    if not len(labels):
        raise ValueError("there are no labelled pixels to fit a temperature to")
    logged = logarithms(distributions.double())

    def mean_cost(inverse: float) -> float:
        return float(torch.nn.functional.cross_entropy(logged * inverse, labels.long()))

    found = minimize_scalar(mean_cost, bounds=(1 / HOTTEST, 1 / COLDEST), method="bounded", options={"xatol": 1e-4})
    return 1 / float(found.x)


def expected_calibration_error(
    distributions: Float[Tensor, "n class"], labels: Int[Tensor, " n"], bins: int = BINS
) -> float:
    """Mean over pixels of |confidence - accuracy| of their bin (ECE), by torchmetrics."""
    distributions = distributions.clamp(max=1)  # torchmetrics would take them for logits if rounding put one above 1
    return float(multiclass_calibration_error(distributions, labels.long(), distributions.shape[-1], bins, "l1"))


def reliability(
    distributions: Float[Tensor, "n class"], labels: Int[Tensor, " n"], bins: int = BINS
) -> tuple[Bin, ...]:
    """The bins of a reliability plot: pixels by their largest probability, in (low, high], and how many were right."""
    confidence, said = distributions.double().max(-1)
    right = (said == labels).double()
    of = torch.bucketize(confidence, torch.linspace(0, 1, bins + 1, dtype=torch.float64)[1:-1])
    counts = torch.bincount(of, minlength=bins).double()
    sums = [torch.bincount(of, weights=values, minlength=bins) / counts.clamp(min=1) for values in (confidence, right)]
    return tuple(Bin(*row) for row in torch.stack((counts / max(len(labels), 1), *sums), 1).tolist())
