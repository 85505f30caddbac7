"""Pieces: what things are made of and what they look like up close. Solids, shells, furniture, materials, textures."""
