"""Depth maps from elsewhere: files of other tools and monocular depth networks, and their alignment to a scene."""
