"""Generate a library of furniture with Infinigen, as a folder of assets."""
