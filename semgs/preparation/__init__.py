"""Preparing data sets: scenes of any layout as small archives, for training."""
