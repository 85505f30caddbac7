"""RGB-D recordings with poses in text files."""
