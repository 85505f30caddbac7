"""Which frames are compared, and what methods predict for them, in memory and in files."""
