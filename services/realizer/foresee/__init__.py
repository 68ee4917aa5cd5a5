"""Expected times of a running block: from what was measured, and from what others expect."""
