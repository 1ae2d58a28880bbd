"""The scale of grains: discrete simulations, forces from images, and the friction law of contacts."""

from granular.grain_scale import dem, friction_law, inference

__all__ = ["dem", "friction_law", "inference"]
