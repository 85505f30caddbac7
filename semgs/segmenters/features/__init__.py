"""Features of Gaussians, from whatever network looked at the photos."""
