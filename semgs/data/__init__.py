"""Scenes on disk: their readers, frames, views and class tables, the choice of frames, and near and far."""
