"""What a training learns from, and how it is validated."""
