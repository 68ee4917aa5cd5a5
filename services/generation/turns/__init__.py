"""The turn policy: who has the floor, and what a turn's fragments are to each other."""
