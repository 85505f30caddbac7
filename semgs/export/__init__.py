"""Export: scenes and point clouds in files that other tools open."""
