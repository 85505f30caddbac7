"""Replica, as Semantic-NeRF rendered it."""
