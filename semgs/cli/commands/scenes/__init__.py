"""Commands that read, make or show scenes."""
