"""Scenes as compact zip files, for training."""
