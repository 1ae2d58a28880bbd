"""Forces between grains, and the friction of sheared grains."""
