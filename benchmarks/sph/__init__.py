"""Smoothed particle hydrodynamics: examples, speed."""
