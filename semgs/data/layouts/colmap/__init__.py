"""COLMAP models."""
