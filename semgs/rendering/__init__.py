"""Rendering: Gaussians and cameras in; images, class maps, depth and alpha out."""
