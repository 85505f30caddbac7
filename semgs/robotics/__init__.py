"""What a robot needs from a scene: things with their boxes, and the floor that is free."""
