"""Depth bounds, and what views can measure of depth."""
