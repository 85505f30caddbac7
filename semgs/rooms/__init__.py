"""Rooms: labelled scenes from a seed. Folders from the ground up: pieces, assets, plans, drawing, sets."""
