"""Scores of single targets, summaries with intervals, and simple baselines."""
