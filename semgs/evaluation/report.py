"""The old name of `semgs.evaluation.tables.report`, for one release."""

from semgs.evaluation.tables.report import read_report as read_report
