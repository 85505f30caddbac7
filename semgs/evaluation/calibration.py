"""The old name of `semgs.evaluation.scoring.confidence`, for one release."""

from semgs.evaluation.scoring.confidence import statements as statements
from semgs.evaluation.scoring.confidence import temperature_effect as calibration

__all__ = ["calibration", "statements"]
