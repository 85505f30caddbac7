"""Export: scene files, and PLY files for other tools."""
