"""Layouts: one module per layout of scenes on disk."""
