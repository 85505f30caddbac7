"""ScanNet."""
