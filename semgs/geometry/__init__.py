"""Geometry in torch alone: cameras, rotations, Gaussians, harmonics, the plane sweep. No file, no network."""
