"""Gaussian splats of other programs: their files, and scenes made of them."""
