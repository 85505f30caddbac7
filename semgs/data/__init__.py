"""Data: views, class tables, scene readers, the choice of views, depth ranges, ray casting."""
