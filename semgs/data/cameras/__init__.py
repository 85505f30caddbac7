"""Lenses with distortion, undone to a pinhole on reading."""
