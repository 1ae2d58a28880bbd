"""The cases of the map of failure, by their kind."""
