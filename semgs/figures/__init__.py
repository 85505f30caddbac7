"""Figures: class colours, depth images, and the building blocks of HTML reports."""
