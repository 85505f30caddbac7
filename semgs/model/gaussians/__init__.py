"""Heads, and Gaussians on the rays of their pixels."""
