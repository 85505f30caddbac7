"""The run folder: log, checkpoints, sessions and faults."""
