"""The old name of `semgs.evaluation.scoring.calibration`, for one release."""

from semgs.evaluation.scoring.calibration import calibration as calibration
from semgs.evaluation.scoring.calibration import statements as statements
