"""Drawing: from a plan to pixels. The room as rays need it, its light, shading, and what a camera does to the picture."""
