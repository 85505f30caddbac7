"""Floor plans: which furniture is where in a room, by the rules of each style."""
