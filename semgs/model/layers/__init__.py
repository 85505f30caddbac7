"""Layers and formats that the parts of the network share."""
