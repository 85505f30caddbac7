"""Near and far of a scene, and the parallax between its images."""
