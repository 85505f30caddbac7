"""Data: views and class tables, readers of scenes, the choice of views, the depth range, ray casting."""
