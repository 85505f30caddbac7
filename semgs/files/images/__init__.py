"""Image files, colour maps, and images in notebooks."""
