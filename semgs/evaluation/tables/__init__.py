"""Reports and tables: report.json, and what `semgs compare` prints."""
