"""The steps from posed photos to a labelled scene: choose, read, encode, place, label, refine, render, score."""
