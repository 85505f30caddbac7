"""While tests run, arrays whose shape does not fit a function's annotation raise an error (conftest.py)."""

from __future__ import annotations

import os

import numpy as np
import pytest
import torch
from jaxtyping import TypeCheckError

from semgs.files.text import counted
from semgs.geometry.cameras import back_project, inverse_rigid
from semgs.scene.coarse_depth import FinerDepth
from semgs.training.data.photo_camera import blur


def test_a_shape_that_does_not_fit_its_annotation_is_refused():
    assert inverse_rigid(torch.eye(4)[None]).shape == (1, 4, 4)
    with pytest.raises(TypeCheckError, match="transforms"):
        inverse_rigid(torch.eye(3)[None])
    with pytest.raises(TypeCheckError, match="depths"):
        back_project(torch.ones(5), None)


def test_a_shape_that_a_module_has_a_name_for_is_checked_too():
    assert blur(np.zeros((4, 5, 3)), 0.0).shape == (4, 5, 3)
    with pytest.raises(TypeCheckError, match="image"):
        blur(np.zeros((4, 5)), 0.0)


def test_the_fields_of_a_dataclass_are_checked_together():
    assert FinerDepth(torch.ones(2, 4, 5), torch.ones(2, 4, 5)).mode.shape == (2, 4, 5)
    with pytest.raises(TypeCheckError, match="mode"):
        FinerDepth(torch.ones(2, 4, 5), torch.ones(2, 4, 6))


@pytest.mark.skipif("CHECK_TYPES" in os.environ, reason="all types are checked")
def test_a_function_without_shapes_costs_nothing():
    assert not hasattr(counted, "__wrapped__")
    assert hasattr(inverse_rigid, "__wrapped__")
