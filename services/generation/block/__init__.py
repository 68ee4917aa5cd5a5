"""Emission: makes a block of a fragment and of what the policies chose, with the instants of looks and gestures."""
