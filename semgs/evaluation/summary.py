"""The old name of `semgs.evaluation.scoring.summary`, for one release."""

from semgs.evaluation.scoring.summary import summary as summary
