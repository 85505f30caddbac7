"""Furniture and what it is made of: solids, triangle shells, materials and textures."""
