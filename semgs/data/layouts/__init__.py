"""Readers: one module or folder for each layout of scenes on disk."""
