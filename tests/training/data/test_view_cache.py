"""Decoded views in memory: a bound on their bytes, and the same samples with and without them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch
from posed import posed_views
from scenes_on_disk import write_labelled

from semgs.data.frames import Frame
from semgs.data.scenes import open_scene
from semgs.training.data.augmentation_settings import Augmentation
from semgs.training.data.samples import Folder, Form, Mixture, Samples
from semgs.training.data.view_cache import ViewCache

SIZE = (32, 48)
IMAGE = 3 * 32 * 48 * 4
"""The bytes of a view of this size without labels and depths."""


def test_what_was_used_last_stays_as_far_as_memory_allows() -> None:
    views, read = posed_views(1, SIZE, seed=0), []

    def reading(name: str):
        return lambda: read.append(name) or views

    cache = ViewCache(2 * IMAGE)
    for name in "abacab":  # c takes the place of b, then b that of c
        assert cache.get(name, reading(name)) is views
    assert read == ["a", "b", "c", "b"]


def test_labels_and_depths_count_and_what_is_larger_than_the_limit_is_not_kept() -> None:
    labels, depths = torch.zeros(1, *SIZE, dtype=torch.uint8), torch.ones(1, *SIZE)
    views, read = replace(posed_views(1, SIZE, seed=0), labels=labels, depths=depths), []
    whole = IMAGE + 32 * 48 * (1 + 4)
    for limit, times in ((whole, 1), (whole - 1, 2), (0, 2)):
        cache = ViewCache(limit)
        read.clear()
        for _ in range(2):
            cache.get("a", lambda: read.append("a") or views)
        assert len(read) == times


def test_what_cannot_be_read_is_read_again() -> None:
    cache = ViewCache(IMAGE)

    def fail():
        raise OSError("gone")

    with pytest.raises(OSError, match="gone"):
        cache.get("a", fail)
    assert cache.get("a", lambda: posed_views(1, SIZE, seed=0)).size == SIZE


def test_samples_are_the_same_with_a_cache_and_each_frame_is_decoded_once(tmp_path: Path, monkeypatch) -> None:
    paths = tuple(write_labelled(tmp_path / f"scene{number}", number, labels=(0, 1)) for number in range(2))
    form = Form(
        (16, 24), (2, 3), 1, open_scene(paths[0]).classes, augmentation=Augmentation(colour=0.3, crop=0.6, flip=True)
    )
    mixture, decoded, view = Mixture(None, (Folder(paths),), (1.0,)), [], Frame.view

    def counted(frame: Frame, *arguments):
        decoded.append(frame.picture)
        return view(frame, *arguments)

    monkeypatch.setattr(Frame, "view", counted)
    plain = [Samples(5, mixture, form, 2)[k] for k in range(12)]
    decoded.clear()
    samples = Samples(5, mixture, form, 2, cache=2**20)
    for k in range(12):
        sample = samples[k]
        assert torch.equal(sample.context.images, plain[k].context.images)
        assert torch.equal(sample.target.depths, plain[k].target.depths)
        assert torch.equal(sample.context.labels, plain[k].context.labels)
    assert len(decoded) == len(set(decoded)) <= sum(len(open_scene(path).frames) for path in paths)
