"""Bench: measures time and memory."""
