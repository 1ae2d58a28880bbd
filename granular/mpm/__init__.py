"""The material point method: scene, scheme, walls and bodies, and the simulation that runs them."""
