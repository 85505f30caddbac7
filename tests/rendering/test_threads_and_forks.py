"""Rendering from several threads, and in forked processes."""

from __future__ import annotations

import multiprocessing
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch
from networks import preset
from posed import posed_views

from semgs.rendering.render import render


def test_eight_threads_that_render_at_once_get_the_bits_of_one(random_scene):
    scenes = [random_scene(seed, 300, 2, (24, 33)) for seed in range(8)]
    alone = [render(*scene) for scene in scenes]
    with ThreadPoolExecutor(8) as pool:
        together = list(pool.map(lambda scene: render(*scene), scenes * 2))
    for one, other in zip(alone * 2, together, strict=True):
        assert torch.equal(one.images, other.images)
        assert torch.equal(one.depths, other.depths)


@pytest.mark.long  # it forks a process with threads; tests/runtime/test_kernels.py has the small form, in an interpreter of its own
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_process_forked_after_rendering_neither_renders_nor_encodes_and_says_why(random_scene):
    scene = random_scene(1, 30, 1, (16, 23))
    model, views = preset("small_plain"), posed_views(2, (32, 48))
    render(*scene)
    parent, child = multiprocessing.Pipe()

    def work() -> None:
        for call in (lambda: render(*scene), lambda: model(views)):
            try:
                child.send(str(call()))
            except RuntimeError as error:
                child.send(str(error))

    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    for _ in range(2):
        assert parent.poll(20)
        assert "start it with multiprocessing.get_context('spawn')" in parent.recv()
    process.join(20)
