"""Heat between grains, walls and surroundings: what is generated, how it flows, and its books."""
