"""Recordings: builds one scene from many frames, window by window.

`keyframes` decides which frames are used and which go together, `merging` reconciles what they say about each surface, `voxels` joins what is nearly the same,
`mapper` does all three frame by frame, `stream` is that as a Python generator, and `semgs.run.steps.recording` maps a scene on disk.
"""
