"""Recordings: builds one scene from many frames, window by window."""
