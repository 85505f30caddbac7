"""Structure from motion: cameras of photos that have none, and better ones for photos whose cameras are slightly wrong."""
