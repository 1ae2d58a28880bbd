"""Grain scale: discrete simulations, inference of contact forces, and the friction law."""

from granular.grain_scale import dem, friction_law, inference

__all__ = ["dem", "friction_law", "inference"]
