"""Commands that run a robot, its router and its keys."""
