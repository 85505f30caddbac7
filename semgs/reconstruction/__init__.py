"""Reconstruction: from a scene on disk to a labelled Gaussian scene."""
