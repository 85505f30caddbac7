"""Captures of phone apps, as folders or zip archives."""
