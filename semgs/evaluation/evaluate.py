"""The old name of `semgs.evaluation.scoring.evaluate`, for one release."""

from semgs.evaluation.scoring.evaluate import evaluate as evaluate
