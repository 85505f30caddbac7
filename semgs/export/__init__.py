"""Export: scene files, and files for other programs."""
