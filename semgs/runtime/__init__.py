"""The process: kernels, compile time, free memory, precision, workers and stopwatch."""
