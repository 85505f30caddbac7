"""The old name of `semgs.evaluation.frames.frame_plan`, for one release."""

from semgs.evaluation.frames.frame_plan import make_plan as make_plan
from semgs.evaluation.frames.frame_plan import pinned_plan as pinned_plan
