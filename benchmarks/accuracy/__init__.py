"""Cases, runs, errors and pictures of `benchmarks/speed_accuracy.py`."""
