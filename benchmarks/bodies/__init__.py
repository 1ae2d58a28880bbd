"""Bodies: rest and flow on surfaces through the grid, free bodies, tools in soil."""
