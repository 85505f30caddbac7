"""Geometry in torch alone: cameras, rotations, Gaussians, harmonics, the plane sweep, fusion of views. No file, no network."""
