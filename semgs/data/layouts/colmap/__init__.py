"""COLMAP's models."""
