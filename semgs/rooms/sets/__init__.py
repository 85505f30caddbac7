"""Sets: cameras on their way through rooms, and samples, scenes and data sets of what they see."""
