"""Simulation of a person at the tangram table, as the anchor study saw people, and of cameras and a microphone."""
