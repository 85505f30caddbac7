"""Figures: class colours, pictures of depth, the HTML page of every command."""
