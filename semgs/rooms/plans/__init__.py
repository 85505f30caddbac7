"""Plans: what stands where in a room, by the rules of each style."""
