"""Scores of single targets, their summaries with intervals, and the simple baselines."""
