"""A library of furniture made with Infinigen, in the form of a folder of assets."""
