"""Cameras with lenses: distortion, crops and sizes."""
