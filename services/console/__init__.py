"""Views of a running system for people: a live view, a plain log, and the tally at the end. Only readers."""
