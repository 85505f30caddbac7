"""Weights: their file format, included weights, foreign names, loading."""
