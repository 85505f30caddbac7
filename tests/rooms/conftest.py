"""Fixtures of the tests of rooms."""

from asset_folders import asset_folder, box_mesh, write_mesh

__all__ = ["asset_folder", "box_mesh", "write_mesh"]
