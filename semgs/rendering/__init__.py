"""Rendering: Gaussians and cameras in, pictures, class maps, depth and alpha out."""
