"""Segmentation networks: exported files and models of the Hugging Face hub."""
