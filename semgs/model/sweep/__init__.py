"""Depth by plane sweep."""
