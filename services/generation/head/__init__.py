"""Decides what the head looks at: claims of maintenance and response policy, inhibitions, and the arbiter of them."""
