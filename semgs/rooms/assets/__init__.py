"""Collected furniture and pictures, used by rooms where a folder of them is given."""
