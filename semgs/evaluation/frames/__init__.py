"""Which frames are compared, and what methods say of them, in memory and in files."""
