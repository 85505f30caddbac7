"""Weights: their file format, what ships, foreign names, loading."""
