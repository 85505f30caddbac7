"""Tests the cameras of a scene against its images and depth maps, and names the usual mistakes."""
