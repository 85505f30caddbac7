"""Transformers: between views with cameras, and inside windows."""
