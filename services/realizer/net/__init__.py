"""The Petri net as data, and as PNML."""
