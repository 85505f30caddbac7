"""Bench: how long things take, how much memory they need, and whether that is what was aimed at."""
