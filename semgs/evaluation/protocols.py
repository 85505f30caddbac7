"""The old name of `semgs.evaluation.frames.protocols`, for one release."""

from semgs.evaluation.frames.protocols import neighbours as neighbours
from semgs.evaluation.frames.protocols import peers as peers
