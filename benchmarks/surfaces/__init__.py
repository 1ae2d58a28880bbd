"""Cases of `benchmarks/bodies.py`: material at rest and in flow on bodies through the grid."""
