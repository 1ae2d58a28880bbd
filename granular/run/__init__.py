"""Runs: simulation, steps, samples and verdict, resuming, sweeps, comparison."""
