"""Data sets that scenezoo reads: ARKitScenes, Matterport3D, MultiScan, 3RScan and Structured3D."""
