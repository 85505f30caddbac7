"""The old name of `semgs.evaluation.tables.evaluation_report`, for one release."""

from semgs.evaluation.tables.evaluation_report import read_report as read_report
