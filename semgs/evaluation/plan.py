"""The old name of `semgs.evaluation.frames.plan`, for one release."""

from semgs.evaluation.frames.plan import make_plan as make_plan
from semgs.evaluation.frames.plan import pinned_plan as pinned_plan
