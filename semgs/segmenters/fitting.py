"""Fits, on labelled scenes, what a segmenter's classes mean in ours, and how much it and the network should each vote."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Float64, UInt8
from torch import Tensor

from semgs.data.scene import Scene
from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.data.views import Views
from semgs.files.atomic import write_json
from semgs.files.errors import InputError
from semgs.files.records import make_record
from semgs.files.strict_json import read_json
from semgs.geometry.fusion import LEAST
from semgs.segmenters.class_source import ClassSource
from semgs.segmenters.labelling import ClassVotes
from semgs.segmenters.names import Correspondence

FORMAT = "semgs.correspondence"
VERSION = 1

PRIOR_POWER = 0.5
"""The class frequency of the scenes is divided out to this power: scenes elsewhere have other frequencies."""

PIXELS = 2000
"""Pixels of each view that the votes are fitted on."""

STEPS = 60
HELD = 1e-3
"""Weight of the squared distance of the votes from their start, so that rare classes stay near it."""


@dataclass(frozen=True)
class Fit:
    """What was fitted for a segmenter.

    Attributes:
        segmenter: name of it.
        theirs: its class names, in order.
        correspondence: from its classes to ours.
        votes: of it and a network; None if they were not fitted.
    """

    segmenter: str
    theirs: tuple[str, ...]
    correspondence: Correspondence
    votes: ClassVotes | None = None


def count_pairs(
    source: ClassSource, scene: Scene, views: Views, positions: Sequence[int], ours: int
) -> Float64[np.ndarray, "theirs ours"]:
    """How much probability a source gives each of its classes at the pixels of each of ours.

    Args:
        source: in its own table.
        scene: contains the frames.
        views: the frames as read, with labels [v h w].
        positions: of the frames in the scene.
        ours: number of our classes.

    Raises:
        InputError: as `ClassSource.of`.
    """
    found = np.zeros((len(source.classes), ours))
    assert views.labels is not None
    for position, labels in zip(positions, views.labels, strict=True):
        said = source.of(scene.frames[position], views.size).flatten(1).double()
        true = labels.flatten().long()
        known = true != IGNORE
        one_hot = torch.nn.functional.one_hot(true[known], ours).to(said)
        found += (said[:, known] @ one_hot).numpy()
    return found


def make_correspondence(counted: Float64[np.ndarray, "theirs ours"], classes: ClassTable) -> Correspondence:
    """P(our class | their class), divided by the square root of the class frequency in the scenes.

    A class of theirs that never occurred says nothing.

    Args:
        counted: the sum of `count_pairs`.
        classes: our table.
    """
    frequency = counted.sum(0) / max(counted.sum(), 1e-12)
    weighed = np.divide(counted, frequency**PRIOR_POWER, out=np.zeros_like(counted), where=frequency > 0)
    sums = weighed.sum(1, keepdims=True)
    table = np.divide(weighed, sums, out=np.zeros_like(weighed), where=sums > 0)
    return Correspondence(table.astype(np.float32), classes)


def fit_votes(
    samples: Iterable[tuple[Float[Tensor, "class n"], Float[Tensor, "class n"], UInt8[Tensor, " n"]]], classes: int
) -> ClassVotes:
    """The votes that make the combined distribution likeliest, found by L-BFGS from equal votes.

    Args:
        samples: of each view, what the segmenter says in our classes, what the network says, and the true labels, without unlabelled pixels.
        classes: number of our classes.
    """
    theirs, own, labels = (torch.cat(parts, -1) for parts in zip(*samples, strict=True))
    logs = torch.stack(((theirs + LEAST).log(), (own + LEAST).log())).double()
    start = torch.stack((torch.ones(classes), torch.ones(classes), torch.zeros(classes))).double()
    free = start.clone().requires_grad_()
    optimiser = torch.optim.LBFGS([free], max_iter=STEPS, line_search_fn="strong_wolfe")

    def loss() -> Tensor:
        optimiser.zero_grad()
        scores = (free[:2, :, None] * logs).sum(0) + free[2, :, None]
        found = torch.nn.functional.cross_entropy(scores.T, labels.long()) + HELD * (free - start).square().sum()
        found.backward()  # type: ignore[no-untyped-call]
        return found

    optimiser.step(loss)  # type: ignore[no-untyped-call]
    return ClassVotes(*(tuple(round(value, 4) for value in row) for row in free.detach().tolist()))


def sample_pixels(
    views: Views, theirs: Float[Tensor, "v class h w"], own: Float[Tensor, "v class h w"]
) -> tuple[Float[Tensor, "class n"], Float[Tensor, "class n"], UInt8[Tensor, " n"]]:
    """A sample for `fit_votes`: at most `PIXELS` labelled pixels of each view, in even steps."""
    assert views.labels is not None
    known = (views.labels != IGNORE).flatten().nonzero()[:, 0]
    taken = known[:: max(1, len(known) // (PIXELS * len(views)))]
    said, thought = (one.transpose(0, 1).flatten(1)[:, taken] for one in (theirs, own))
    return said, thought, views.labels.flatten()[taken]


def fit_correspondence(
    source: Callable[[Scene], ClassSource],
    scenes: Sequence[Scene],
    read: Callable[[Scene], tuple[Sequence[int], Views]],
    done: Callable[[int], object] = lambda count: None,
) -> Correspondence:
    """The correspondence of a segmenter's classes with those of labelled scenes.

    Args:
        source: of each scene, in the segmenter's own table.
        scenes: with one class table.
        read: the positions and views to use of a scene.
        done: called with the number of finished scenes.

    Raises:
        InputError: as `ClassSource.of`, or the segmenter has other classes for another scene.
    """
    classes, theirs = scenes[0].classes, source(scenes[0]).classes.names
    assert classes is not None
    total: Any = 0
    for number, scene in enumerate(scenes, 1):
        said = source(scene)
        if said.classes.names != theirs:
            raise InputError(said.title, f"the classes of the maps of {scenes[0].name}", f"others for {scene.name}")
        positions, views = read(scene)
        total = total + count_pairs(said, scene, views, positions, len(classes))
        done(number)
    return make_correspondence(total, classes)


def save_fit(path: Path, fitted: Fit) -> None:
    """Write a fit.

    Raises:
        OSError: it cannot be written.
    """
    votes = fitted.votes
    content = {
        "format": FORMAT,
        "version": VERSION,
        "segmenter": fitted.segmenter,
        "theirs": list(fitted.theirs),
        "classes": asdict(fitted.correspondence.classes),
        "table": [[round(float(value), 6) for value in row] for row in fitted.correspondence.table],
        "votes": votes and asdict(votes),
    }
    write_json(path, content)


def read_fit(path: Path) -> Fit:
    """Read a fit.

    Raises:
        InputError: it is missing or damaged.
    """
    expected = "a file that semgs segmenters fit wrote"
    content = read_json(path, expected)
    if not isinstance(content, dict) or content.get("format") != FORMAT or content.get("version") != VERSION:
        raise InputError(path, expected, "another file")
    try:
        classes = make_record(ClassTable, content["classes"])
        table = np.array(content["table"], dtype=np.float32)
        theirs = tuple(str(name) for name in content["theirs"])
        if table.shape != (len(theirs), len(classes)) or not np.isfinite(table).all() or table.min() < 0:
            raise ValueError(f"table is {table.shape}")
        votes = content["votes"] and ClassVotes(
            **{key: tuple(map(float, row)) for key, row in content["votes"].items()}
        )
        if votes and any(len(row) != len(classes) for row in (votes.theirs, votes.own, votes.bias)):
            raise ValueError(f"votes are not of {len(classes)} classes")
        return Fit(str(content["segmenter"]), theirs, Correspondence(table, classes), votes)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(path, expected, f"{type(error).__name__}: {error}") from error
