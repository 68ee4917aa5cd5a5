"""A figure with two arms and a head: its joints, where it aims, and the courses of its gestures. Pure."""
