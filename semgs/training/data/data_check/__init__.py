"""Checks of the scenes before a training starts."""
