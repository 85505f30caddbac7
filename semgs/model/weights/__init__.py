"""Weights files: included, on the hub, published by others, and where a training starts."""
