"""The HTML page of an evaluation, and the figures that compare methods."""
