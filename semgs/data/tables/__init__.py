"""Class tables."""
