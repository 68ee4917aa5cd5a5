"""A world in which nothing moves, and somebody in it who may attend to the robot: for trying things out."""
