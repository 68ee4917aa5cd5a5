"""Emission: makes a block of a fragment and of what the policies chose."""
