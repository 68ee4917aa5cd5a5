"""Planning: from a block to a Petri net and its schedule. No clock."""
