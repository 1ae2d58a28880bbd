"""Smoothed particle hydrodynamics: examples, speed, a jet."""
