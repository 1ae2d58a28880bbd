"""The cases of the map of failure, by what they are made of."""
