"""The Petri net as data, and while it runs."""
