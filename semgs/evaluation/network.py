"""The old name of `semgs.evaluation.frames.network`, for one release."""

from semgs.evaluation.frames.network import NetworkMethod as NetworkMethod
