"""Training: samples, the step, the loop."""
