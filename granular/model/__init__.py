"""Parts that a scene of any method is made of: grid, fills, inflows, gravity, state."""
