"""Replica, as rendered by Semantic-NeRF."""
