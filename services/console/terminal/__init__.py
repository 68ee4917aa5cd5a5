"""The view of a robot in a terminal."""
