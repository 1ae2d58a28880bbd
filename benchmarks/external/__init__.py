"""Cases with data of other authors: refinement, limit analysis."""
