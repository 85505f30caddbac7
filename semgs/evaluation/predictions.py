"""The old name of `semgs.evaluation.frames.predictions`, for one release."""

from semgs.evaluation.frames.predictions import Inputs as Inputs
from semgs.evaluation.frames.predictions import Method as Method
from semgs.evaluation.frames.predictions import Prediction as Prediction
