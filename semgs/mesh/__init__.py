"""Meshes: the depth of all input views, fused into one labelled surface."""
