"""`semgs compare`: prints a table of evaluation reports."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from semgs.files.errors import InputError
from semgs.run.options.words import optional, positional
from semgs.run.usage_errors import UsageError, what_the_user_gave


@dataclass(frozen=True)
class Compare:
    """Compare reports of semgs evaluate in one table.

    All reports must have the same frames, size and truth; if not, the error lists the differences. Reports of single images (--single) have a table of their own.

    Examples
    - semgs compare eval/small/report.json
    - semgs compare eval/*/report.json --format latex
    - semgs compare eval/scannet/report.json --published scannet
    - semgs compare eval/before/report.json eval/after/report.json --layout difference
    """

    only_with: ClassVar = {"--layout paper": ("--published",)}

    reports: Annotated[tuple[Path, ...], positional("REPORT.json ...")]
    """Reports, or the folders that contain them. Differences are relative to the first."""
    layout: Literal["paper", "difference", "data", "card"] = "paper"
    """paper: the columns of the paper's tables, then metrics over all targets together. difference: each report minus the first, with paired 95 % bootstrap intervals. data:
    reports of different data, one below the other. card: as data, with intervals and a table of classes, for a model card."""
    published: Annotated[Literal["scannet", "scannetpp", "ablation"] | None, optional()] = None
    """With --layout paper: add the numbers that the paper published, with a note on what is unknown about them."""
    merge: Annotated[str, optional("alike|coarse13|FILE")] = ""
    """Add metrics of groups of classes: alike (table, desk and counter; chair and sofa; curtains), coarse13 (13 groups of ScanNet's 20), or a JSON file; see
    docs/evaluate.md."""
    format: Literal["text", "markdown", "latex"] = "text"
    """For a terminal, a page or a paper (LaTeX with booktabs)."""

    def run(self) -> None:
        """Print the table.

        Raises:
            InputError: a report cannot be read, or has other frames.
            UsageError: the options do not fit the reports.
        """
        for path in self.reports:
            if not path.exists():
                raise InputError(path, "the report.json of an evaluation", "nothing there")
        if self.layout == "difference" and len(self.reports) < 2:
            raise UsageError("--layout difference needs two or more reports")
        from semgs.data.tables.class_groups import class_groups
        from semgs.evaluation.tables.card import card_grids
        from semgs.evaluation.tables.comparison_tables import (
            check_comparable,
            data_grid,
            difference_grids,
            paper_grid,
            pooled_grid,
            single_grid,
        )
        from semgs.evaluation.tables.published_results import PUBLISHED
        from semgs.evaluation.tables.saved_report import read_report
        from semgs.evaluation.tables.table_grid import printed

        reports = [read_report(path) for path in self.reports]
        if self.merge:
            if any(not report.class_names for report in reports):
                raise UsageError("--merge is for reports with classes; one has none")
            reports = [report.by_groups(class_groups(self.merge, report.class_names)) for report in reports]
        images = [report.path for report in reports if report.single]
        if images and (self.layout == "card" or self.published):
            option = "--published" if self.published else "--layout card"
            raise UsageError(f"{option} is for rendered views; {images[0]} is of single images")
        if self.layout not in ("data", "card"):
            check_comparable(reports)
        with what_the_user_gave():
            if self.layout == "difference":
                grids = difference_grids(reports)
            elif self.layout == "data":
                grids = [data_grid(reports)]
            elif self.layout == "card":
                grids = card_grids(reports)
            elif images:
                grids = [single_grid(reports)]
            else:
                published = PUBLISHED[self.published] if self.published else None
                grids = [paper_grid(reports, published), pooled_grid(reports)]
        print("\n\n".join(printed(grid, self.format) for grid in grids))
