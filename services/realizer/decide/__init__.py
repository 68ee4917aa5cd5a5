"""Decisions from what was measured: what to do next. No clock."""
