"""What to do next, from what was measured. No clock."""
