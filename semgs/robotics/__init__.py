"""What a robot needs from a reconstructed scene: things as boxes, and the floor that is free."""
