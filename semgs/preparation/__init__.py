"""Preparing data sets: converts scenes of any layout to compact zip files for training."""
