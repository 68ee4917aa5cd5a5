"""The tangram of the anchor study, an example of a task: its table, the simulated people at it, and its manager."""
