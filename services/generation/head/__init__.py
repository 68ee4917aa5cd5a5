"""Decides what the head looks at: its policies and inhibitions, each with a claim, and the arbiter of them."""
