"""Decoded views in memory: a bound on their bytes, and the same samples with and without them."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from scenes_on_disk import write_labelled

from semgs.data.frames import Frame
from semgs.data.scenes import open_scene
from semgs.training.data.data_settings import Augmentation
from semgs.training.data.samples import Folder, Form, Mixture, Samples

DRAWN = 12
FRAMES = 12
"""In two scenes of six."""
VIEW = 24 * 32 * (3 * 4 + 1 + 4)
"""The bytes of a view: colours, a label and a depth for each of 24x32 pixels."""


@pytest.fixture
def mixture(tmp_path: Path) -> Mixture:
    paths = tuple(write_labelled(tmp_path / f"scene{number}", number, labels=(0, 1)) for number in range(2))
    return Mixture(None, (Folder(paths),), (1.0,))


@pytest.fixture
def decoded(monkeypatch) -> list[Path]:
    """The pictures of the frames that are decoded from now on."""
    found, view = [], Frame.view

    def counted(frame: Frame, *arguments):
        found.append(frame.picture)
        return view(frame, *arguments)

    monkeypatch.setattr(Frame, "view", counted)
    return found


def samples(mixture: Mixture, cache: int) -> Samples:
    augmentation = Augmentation(colour=0.3, crop=0.6, flip=True)
    form = Form((16, 24), (2, 3), 1, open_scene(mixture.folders[0].paths[0]).classes, augmentation=augmentation)
    return Samples(5, mixture, form, 2, cache=cache)


def test_samples_are_the_same_with_a_cache_and_each_frame_is_decoded_once(mixture, decoded) -> None:
    plain, kept = samples(mixture, 0), samples(mixture, FRAMES * VIEW)
    expected = [plain[k] for k in range(DRAWN)]
    decoded.clear()
    for k in range(DRAWN):
        assert torch.equal(kept[k].context.images, expected[k].context.images)
        assert torch.equal(kept[k].target.depths, expected[k].target.depths)
        assert torch.equal(kept[k].context.labels, expected[k].context.labels)
    assert len(decoded) == len(set(decoded)) == FRAMES


@pytest.mark.parametrize(("limit", "read"), [(0, 8), (4 * VIEW - 1, 8), (4 * VIEW, 4)])
def test_views_are_kept_as_far_as_their_colours_labels_and_depths_fit(mixture, decoded, limit: int, read: int) -> None:
    kept = samples(mixture, limit)
    assert kept.counts(0) == (3, 1)
    for _ in range(2):
        kept[
            0
        ]  # with room for three views, the first makes room for the fourth, then the second for the first, and so on
    assert len(decoded) == read
