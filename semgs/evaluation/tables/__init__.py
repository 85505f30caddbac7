"""Numbers as reports and tables: what report.json holds, and what `semgs compare` prints."""
