"""Adaptors of voice frameworks: their words in, the robot out, and back what was really said. One file for each."""
