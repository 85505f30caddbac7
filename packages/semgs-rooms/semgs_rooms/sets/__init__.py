"""Cameras in rooms, and the samples, scenes and data sets that they produce."""
