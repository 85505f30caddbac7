"""How much memory a scene needs, and how many views to process at a time."""
