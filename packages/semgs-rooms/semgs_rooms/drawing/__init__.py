"""Rendering: from a room's solids and lights to images, labels and depths."""
