"""Evaluation: which frames are compared, how they are scored, and the tables of it."""
