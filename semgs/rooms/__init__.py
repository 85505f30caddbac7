"""Rooms: labelled scenes from a seed."""
