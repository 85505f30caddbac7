"""Cameras and depth that a network predicted from photos: files of Depth Anything 3, VGGT, MapAnything, and those made from DUSt3R's results."""
